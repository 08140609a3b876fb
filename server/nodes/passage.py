"""Authentication between web servers: a header with an HMAC identifies the client of a forwarded request.

The key is a file in the shared data folder. The header contains sender, receiver, time, client address and
scheme; the HMAC binds it to this request.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from sagittal.server.storage import fs

HEADER: Final = b"x-sagittal-node"
ASKED_BY: Final = "sagittal.asked_by"
"""Scope key: name of the server that forwarded the request."""
LIFE_S: Final = 60.0
"""Maximum age of a header; the servers' clocks are better synchronized."""
_BOUND: Final = frozenset({b"host", b"cookie", b"authorization", b"origin"})
"""Headers covered by the HMAC."""

Headers = Iterable[tuple[bytes, bytes]]


def read_key(path: Path) -> bytes:
    """Read the key; the first server that needs it creates it."""
    fs.make_folder(path.parent)
    with fs.hold_lock(path.with_name("key.lock")):
        with suppress(FileNotFoundError):
            return bytes.fromhex(path.read_text("ascii"))
        key = secrets.token_bytes(32)
        fs.write_file(path, key.hex().encode())
    return key


def write_line(key: bytes, asks: str, receiver: str, scope: Mapping[str, Any]) -> bytes:
    """Header value for a request that is forwarded unchanged."""
    client = scope["client"][0] if scope.get("client") else ""
    line = f"{asks};{receiver};{int(time.time())};{client};{scope['scheme']}"
    return f"{line};{sign(key, line, scope)}".encode("latin-1")


def sign(key: bytes, line: str, scope: Mapping[str, Any]) -> str:
    """HMAC of a header and the request it belongs to, as hexadecimal digits."""
    bound: Headers = sorted(one for one in scope["headers"] if one[0] in _BOUND)
    parts = (
        line.encode("latin-1"),
        scope.get("method", "GET").encode(),
        scope.get("raw_path") or scope["path"].encode(),
        scope["query_string"],
        *(part for one in bound for part in one),
    )
    digest = hmac.new(key, digestmod=hashlib.sha256)
    for part in parts:
        digest.update(len(part).to_bytes(4, "big") + part)
    return digest.hexdigest()
