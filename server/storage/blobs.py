"""Content-addressed files: `blobs/<space>/<sha256>`, immutable, verified at every read.

A space is a patient's id. The same bytes of two patients are two files, so that an upload cannot reveal what
another patient has (no existence oracle) and an erased patient is an erased folder.

A file is always written anew and renamed over an equal one: that costs a write, repairs a damaged file, and
makes the file young, so that the sweep of unreferenced files cannot take what somebody is about to refer to.
"""

from __future__ import annotations

import hashlib
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Self

from core.errors import SagittalError
from server.storage import fs

_PIECE = 1 << 20
_HEX32 = re.compile(r"[0-9a-f]{32}")
_HEX64 = re.compile(r"[0-9a-f]{64}")
INCOMING = "incoming"
"""The space of files that are being received, or were when their process died."""


class IntegrityError(SagittalError):
    """A stored file is gone or its bytes are not those that were stored."""

    status = 500


@dataclass(frozen=True)
class Blob:
    """A stored file: its content's hash and its length in bytes."""

    sha256: str
    size: int


@dataclass(frozen=True)
class BlobFile:
    """A file found in the store, referred to or not; `age_s` since it was written."""

    space: str
    name: str
    path: Path
    age_s: float

    def is_older(self, age_s: float) -> bool:
        """Look again: nobody has written it anew since it was found."""
        try:
            return time.time() - self.path.stat().st_mtime >= age_s
        except FileNotFoundError:
            return False


class BlobStore:
    """The folder of all blobs.

    Parameters
    ----------
    root : made if absent.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.incoming = root / INCOMING
        fs.make_folder(self.incoming)

    def receive(self, space: str, limit: int | None = None) -> Receiver:
        """Take a file in chunks: `with store.receive(pid, limit) as r: r.write(chunk); blob = r.keep()`."""
        return Receiver(self.path(space, "0" * 64).parent, self.incoming, limit)

    def put(self, space: str, content: bytes) -> Blob:
        """Store bytes; when this returns they survive a power cut."""
        with self.receive(space) as receiver:
            receiver.write(content)
            return receiver.keep()

    def part(self, upload_id: str) -> Path:
        """Where a file that comes in parts waits to be whole (services/uploads.py)."""
        return self.incoming / self.name_part(upload_id)

    @staticmethod
    def name_part(upload_id: str) -> str:
        """Name of that file."""
        if not _HEX32.fullmatch(upload_id):
            raise ValueError(f"'{upload_id}' is not the id of an upload.")
        return f"{upload_id}.part"

    def adopt(self, space: str, path: Path, sha256: str) -> None:
        """Give a synced file of the store, with this content, its name; it survives a power cut under it."""
        target = self.path(space, sha256)
        fs.move_file(path, target)
        for folder in {target.parent, path.parent}:
            fs.sync_folder(folder)

    def probe(self) -> None:
        """Write a page into the folder and remove it again; raises OSError."""
        with self.receive("0" * 32) as receiver:
            receiver.write(bytes(4096))

    def read(self, space: str, sha256: str) -> bytes:
        """Return the bytes, or raise IntegrityError (blob_missing, blob_damaged)."""
        path = self.path(space, sha256)
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            raise _missing(sha256) from None
        if hashlib.sha256(content).hexdigest() != sha256:
            raise _damaged(sha256)
        return content

    def open(self, space: str, sha256: str) -> BinaryIO:
        """Open the bytes, verified before the first is given; raises IntegrityError as `read`."""
        path = self.path(space, sha256)
        try:
            file = path.open("rb")
        except FileNotFoundError:
            raise _missing(sha256) from None
        digest = hashlib.sha256()
        while piece := file.read(_PIECE):
            digest.update(piece)
        if digest.hexdigest() != sha256:
            file.close()
            raise _damaged(sha256)
        file.seek(0)
        return file

    def require(self, space: str, sha256: str) -> None:
        """Raise IntegrityError unless the file is there; call it in the transaction that refers to it."""
        if not self.path(space, sha256).is_file():
            raise _missing(sha256)

    def path(self, space: str, sha256: str) -> Path:
        """Where a blob lives."""
        if not (_HEX32.fullmatch(space) and _HEX64.fullmatch(sha256)):
            raise ValueError(f"'{space}/{sha256}' is not the address of a blob.")
        return self.root / space / sha256

    def files(self) -> Iterator[BlobFile]:
        """Every file of ours in the store, half-received ones too (their space is INCOMING)."""
        for folder in sorted(self.root.iterdir()):
            if not (folder.is_dir() and (folder.name == INCOMING or _HEX32.fullmatch(folder.name))):
                continue
            for path in sorted(folder.iterdir()):
                try:
                    age_s = time.time() - path.stat().st_mtime
                except FileNotFoundError:
                    continue
                yield BlobFile(folder.name, path.name, path, age_s)

    def remove(self, space: str, sha256: str) -> None:
        """Remove one file for good; gone already is fine."""
        fs.remove_file(self.path(space, sha256))

    def erase(self, space: str) -> None:
        """Remove a whole space."""
        fs.remove_folder(self.path(space, "0" * 64).parent)


class Receiver:
    """One blob on its way in."""

    def __init__(self, target: Path, incoming: Path, limit: int | None) -> None:
        self._target = target
        self._file = fs.IncomingFile(incoming, limit)

    def write(self, data: bytes) -> None:
        """Append bytes; raises fs.SizeLimitError beyond the limit."""
        self._file.write(data)

    def keep(self) -> Blob:
        """Give the file its name."""
        fs.make_folder(self._target)
        self._file.keep(self._target / self._file.sha256)
        return Blob(self._file.sha256, self._file.size)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.__exit__(None, None, None)


def _damaged(sha256: str) -> IntegrityError:
    return IntegrityError(
        "blob_damaged",
        f"The stored file {sha256[:12]}… has changed on the disk; its content is not used. "
        "Restore it from a backup or upload the original again.",
    )


def _missing(sha256: str) -> IntegrityError:
    return IntegrityError(
        "blob_missing",
        f"The stored file {sha256[:12]}… is not there. "
        "Restore it from a backup or upload the original again.",
    )
