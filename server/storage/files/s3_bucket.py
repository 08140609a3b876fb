"""S3-compatible bucket: library calls with our error types and timeouts."""

from __future__ import annotations

import contextlib
import datetime as dt
import ipaddress
import logging
import os
import re
import time
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final
from urllib.parse import urlsplit

from sagittal.server.settings import LOOPBACK, SettingsError
from sagittal.server.storage import fs
from sagittal.server.storage.files.blobs import PIECE, StoreAway

if TYPE_CHECKING:
    from obstore.store import S3Store

log = logging.getLogger(__name__)

CONNECT_S: Final = 3.0
WHOLE_S: Final = 3600.0
"""Time limit for one file."""
RETRY_S: Final = 10.0
"""Time within which a failed request is retried."""
REST_S, LONGEST_REST_S = 2.0, 15.0
"""After the store was unavailable, requests fail immediately for this long, or as long as the failure took: a
list needs many files, and waiting threads block other pages.
"""
PUT_BYTES: Final = 5 << 20
PUT_AT_ONCE: Final = 2
DELETE_AT_ONCE: Final = 1000
_AWAY: Final = re.compile(r"HTTP error|status code: (5\d\d|408|429)|timed out|server error", re.IGNORECASE)
_NO_KEYS: Final = "/latest/api/token"
"""Where cloud machines obtain keys if the environment has none."""


class S3Bucket:
    """A prefix of a bucket, s3://name/prefix.

    Parameters
    ----------
    silence_s : timeout for a response of the store. retries : number of retries of a request.

    Raises
    ------
    SettingsError
        the library is not installed, or the endpoint cannot be used.
    """

    def __init__(self, url: str, silence_s: float, retries: int) -> None:
        try:
            import obstore
        except ImportError:
            raise SettingsError(
                "bucket is set, but the library that speaks S3 is not installed: pip install 'sagittal[s3]'."
            ) from None
        self._lib = obstore
        self.url = url
        name, _, prefix = url.removeprefix("s3://").partition("/")
        self._away = ("", 0.0)
        self._store = _open_store(name, prefix, silence_s, retries)

    def put(self, key: str, content: bytes | Path) -> str | None:
        """Store an object; return its version in the bucket, None = unversioned."""
        with self._reached():
            done = self._lib.put(self._store, key, content, chunk_size=PUT_BYTES, max_concurrency=PUT_AT_ONCE)
        return done["version"]

    def load(self, key: str) -> bytes | None:
        """Content of an object; None = it does not exist."""
        with contextlib.suppress(_AbsentError), self._reached():
            return bytes(self._lib.get(self._store, key).bytes())
        return None

    def load_part(self, key: str, start: int, stop: int) -> bytes | None:
        """Part of an object; None = it does not exist."""
        with contextlib.suppress(_AbsentError), self._reached():
            return bytes(self._lib.get_range(self._store, key, start=start, end=stop))
        return None

    def fetch(self, key: str, folder: Path) -> BinaryIO | None:
        """An object as an anonymous local file, positioned at its start; None = it does not exist."""
        file = fs.open_scratch(folder)
        try:
            with self._reached():
                pieces = iter(self._lib.get(self._store, key).stream(min_chunk_size=PIECE))
            while True:
                with self._reached():
                    piece = next(pieces, None)
                if piece is None:
                    break
                file.write(piece)
            file.seek(0)
        except _AbsentError:
            file.close()
            return None
        except BaseException:
            file.close()
            raise
        return file

    def find(self, key: str) -> Any:
        """Size and time of an object; None = it does not exist."""
        with contextlib.suppress(_AbsentError), self._reached():
            return self._lib.head(self._store, key)
        return None

    def list(self, prefix: str) -> Iterator[Any]:
        """All objects under a prefix, by name."""
        pages = iter(self._lib.list(self._store, prefix.rstrip("/") or None))
        while True:
            with self._reached():
                page = next(pages, None)
            if page is None:
                return
            yield from page

    def copy(self, source: str, target: str) -> None:
        """Copy an object within the bucket; a missing one is skipped."""
        with contextlib.suppress(_AbsentError), self._reached():
            self._lib.copy(self._store, source, target)

    def delete(self, keys: Collection[str]) -> None:
        """Permanently remove objects; no error if absent."""
        every = list(keys)
        for i in range(0, len(every), DELETE_AT_ONCE):
            with contextlib.suppress(_AbsentError), self._reached():
                self._lib.delete(self._store, every[i : i + DELETE_AT_ONCE])

    @contextlib.contextmanager
    def _reached(self) -> Iterator[None]:
        """Convert library errors to StoreAway, or to _AbsentError for a missing object."""
        detail, until = self._away
        began = time.monotonic()
        if began < until:
            raise StoreAway(detail, refuses=False)
        try:
            yield
        except (self._lib.exceptions.BaseError, OSError) as error:
            if isinstance(error, OSError) and error.errno is not None:
                raise  # of a local file
            text = str(error)
            # the response to HEAD has no message; another 404 means a wrong store or a missing bucket
            if isinstance(error, FileNotFoundError) and ("NoSuchKey" in text or "performing HEAD" in text):
                raise _AbsentError from None
            detail = _shorten(text)
            log.warning("bucket %s: %s", self.url, detail)
            refuses = _AWAY.search(text) is None or _NO_KEYS in text
            if not refuses:
                ended = time.monotonic()
                rest_s = min(max(REST_S, ended - began), LONGEST_REST_S) if REST_S else 0.0
                self._away = (detail, ended + rest_s)
            raise StoreAway(detail, refuses=refuses) from error


class _AbsentError(Exception):
    """The object does not exist."""


def _shorten(text: str) -> str:
    """Message of the store's response, or of the failure to reach it."""
    match = re.search(r"<Code>(.*?)</Code>\s*(?:<Message>(.*?)</Message>)?", text)
    if match is not None:
        return ": ".join(part for part in match.groups() if part)[:300]
    return text.split("\n", 1)[0].strip()[:300]


def _open_store(name: str, prefix: str, silence_s: float, retries: int) -> S3Store:
    from obstore.exceptions import BaseError
    from obstore.store import S3Store

    try:
        return S3Store(
            name,
            prefix=prefix or None,
            client_options={
                "allow_http": _may_be_plain(),
                "connect_timeout": dt.timedelta(seconds=CONNECT_S),
                "read_timeout": dt.timedelta(seconds=silence_s),
                "timeout": dt.timedelta(seconds=WHOLE_S),
            },
            retry_config={
                "max_retries": retries,
                "retry_timeout": dt.timedelta(seconds=min(RETRY_S, silence_s)),
                "backoff": {"max_backoff": dt.timedelta(seconds=1)},
            },
        )
    except (BaseError, ValueError) as error:
        text = str(error).split("\n", 1)[0][:300]
        raise SettingsError(f"The bucket {name} cannot be used as it is set: {text}") from None


def _may_be_plain() -> bool:
    """Whether the endpoint may be used without TLS: on this computer, or if AWS_ALLOW_HTTP permits it.

    Raises
    ------
    SettingsError
        data would cross the network unencrypted.
    """
    names = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
    endpoint = next((os.environ[name] for name in names if os.environ.get(name)), "")
    if not endpoint.startswith("http://"):
        return False
    if _is_loopback(urlsplit(endpoint).hostname or "") or os.environ.get("AWS_ALLOW_HTTP") in {"1", "true"}:
        return True
    raise SettingsError(
        f"The bucket's endpoint is {endpoint}: patients' files would cross the network unencrypted. Give one "
        "with https://, or set AWS_ALLOW_HTTP=true where the network is safe."
    )


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host in LOOPBACK
