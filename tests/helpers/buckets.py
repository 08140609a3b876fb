"""S3 bucket on 127.0.0.1 (moto behind real HTTP) that tests can stop and start."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import httpx
import pytest

from sagittal.server.storage.files import s3_bucket

_numbers = itertools.count(1)
KEYS = {"AWS_ACCESS_KEY_ID": "clinic", "AWS_SECRET_ACCESS_KEY": "of the clinic", "AWS_REGION": "us-east-1"}
UNSET = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT", "AWS_ALLOW_HTTP", "AWS_SESSION_TOKEN", "AWS_PROFILE")


class S3Server:
    """A server whose buckets live as long as this process."""

    def __init__(self) -> None:
        self._server: Any = None
        self.port = 0
        self.start()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Listen; again on the port of the first time."""
        if self._server is None:
            from moto.server import ThreadedMotoServer

            self._server = ThreadedMotoServer("127.0.0.1", self.port, verbose=False)
            self._server.start()
            _, self.port = self._server.get_host_and_port()

    def stop(self) -> None:
        if self._server is not None:
            self._server.stop()
            self._server = None

    def ask(self, method: str, path: str, content: bytes = b"") -> bytes:
        """Request without credentials."""
        with httpx.Client(trust_env=False) as client:
            return client.request(method, self.address + path, content=content).raise_for_status().content


@dataclass
class Bucket:
    """Empty bucket; the environment names its server."""

    server: S3Server
    name: str

    @property
    def url(self) -> str:
        return f"s3://{self.name}/clinic"

    def objects(self) -> set[str]:
        """Every object under the prefix."""
        from moto.backends import get_backend
        from moto.core.models import DEFAULT_ACCOUNT_ID

        backend: Any = get_backend("s3")[DEFAULT_ACCOUNT_ID]["aws"]
        return {key.removeprefix("clinic/") for key in backend.buckets[self.name].keys}

    def write(self, key: str, content: bytes) -> None:
        """Put an object by other means than ours."""
        import obstore
        from obstore.store import S3Store

        store = S3Store(self.name, prefix="clinic", client_options={"allow_http": True})
        obstore.put(store, key, content)


@pytest.fixture(scope="session")
def s3_server() -> Iterator[S3Server]:
    """Skips where the library or the server is not installed."""
    pytest.importorskip("obstore", reason="the extra s3 is not installed: pip install '.[s3]'")
    pytest.importorskip("moto.server", reason="moto is not installed: pip install '.[test]'")
    server = S3Server()
    yield server
    server.stop()


@pytest.fixture
def bucket(s3_server: S3Server, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bucket]:
    """An empty bucket."""
    for name, value in KEYS.items():
        monkeypatch.setenv(name, value)
    for name in UNSET:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("AWS_ENDPOINT_URL", s3_server.address)
    monkeypatch.setattr(s3_bucket, "REST_S", 0.0)  # a server that was started again is asked at once
    result = Bucket(s3_server, f"bucket-{next(_numbers)}")
    s3_server.ask("PUT", f"/{result.name}")
    yield result
    s3_server.start()
