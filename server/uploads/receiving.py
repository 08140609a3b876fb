"""Reception of a file into the upload set of a session: checks of name, size and free space.

with receiving.receive(db, blobs, settings, actor, sid, "left.csv") as upload:
    upload.write(chunk)          # once per chunk; constant memory
    stored = upload.keep()       # file on disk first, then the row
"""

from __future__ import annotations

import shutil
import unicodedata
from typing import Final, Self

from sqlalchemy import Connection

from sagittal.core.errors import InputError
from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.errors import ServiceError, TooLarge
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import Blob, BlobStore
from sagittal.server.storage.fs import SizeLimitError
from sagittal.server.storage.refusal import Refusal
from sagittal.server.uploads.recordings import RecordedFile, add_file, current, patient_of


class receive:  # noqa: N801 - a verb: with receive(...) as upload
    """Context manager that receives a file into the current set; leaving without `keep` discards it.

    Parameters
    ----------
    size : announced bytes, 0 = unknown; free space is checked before the first is received.

    Raises
    ------
    NotFound
        no such session.
    ServiceError
        bad_file_name, disk_full. TooLarge: file_too_large, set_too_large, too_many_files.
    """

    def __init__(
        self,
        db: Database,
        blobs: BlobStore,
        settings: Settings,
        actor: audit.Actor | None,
        session_id: str,
        name: str,
        size: int = 0,
    ) -> None:
        self._db, self._blobs, self._settings, self._actor = db, blobs, settings, actor
        self._session_id = session_id
        self._name = check_name(name)
        with db.read() as c:
            self._space = patient_of(c, session_id)
            self._check_set(c, 0)
        require_room(blobs, settings, size)
        self._receiver = blobs.receive(self._space, settings.max_file_bytes)

    def write(self, data: bytes) -> None:
        """Append bytes; raises TooLarge file_too_large, DiskFull."""
        require_room(self._blobs, self._settings, len(data))
        try:
            self._receiver.write(data)
        except SizeLimitError as error:
            raise make_too_large(self._name, error.limit) from None

    def keep(self) -> RecordedFile:
        """Store the file and its row; replaces a file of the same name in the set."""
        blob = self._receiver.keep()
        with self._db.write() as c:
            self._blobs.require(patient_of(c, self._session_id), blob.sha256)
            self._check_set(c, blob.size)
            return self._add(c, blob)

    def _check_set(self, c: Connection, size: int) -> None:
        check_set(c, self._settings, self._session_id, self._name, size)

    def _add(self, c: Connection, blob: Blob) -> RecordedFile:
        return add_file(c, self._actor, self._session_id, self._name, blob)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._receiver.__exit__(*error)


def check_set(c: Connection, settings: Settings, session_id: str, name: str, size: int) -> None:
    """Raise TooLarge set_too_large, too_many_files if a file of this size does not fit into the set."""
    this = current(c, session_id)
    siblings = [f for f in this.files if f.name != name] if this else []
    if len(siblings) + 1 > settings.max_files:
        raise TooLarge(
            "too_many_files",
            Message("A recording has at most {max_files} files.", max_files=settings.max_files),
        )
    total = sum(f.size for f in siblings) + size
    if total > settings.max_set_bytes:
        raise TooLarge(
            "set_too_large",
            Message(
                "With '{name}' the recording has {total:.0f} MB, at most {max_set_bytes:g} MB are "
                "allowed. Remove files first.",
                name=name,
                total=total / 1e6,
                max_set_bytes=settings.max_set_bytes / 1e6,
            ),
        )


def make_too_large(name: str, limit: int) -> TooLarge:
    """Error for a file that exceeds the size limit in bytes."""
    return TooLarge(
        "file_too_large",
        Message(
            "'{name}' is larger than {limit:g} MB, the limit of this installation. Split the "
            "recording or ask the administrator (SAGITTAL_MAX_FILE_BYTES).",
            name=name,
            limit=limit / 1e6,
        ),
    )


class DiskFull(ServiceError):  # noqa: N818 - the name of the HTTP status
    """Not enough free space to accept a file and continue working."""

    status = 507

    def __init__(self) -> None:
        super().__init__(Refusal.FULL.value, Refusal.FULL.sentence)


def require_room(blobs: BlobStore, settings: Settings, size: int) -> None:
    """Raise DiskFull if this many bytes would not leave the free space required by the settings."""
    if shutil.disk_usage(blobs.incoming).free - size < settings.min_free_bytes:
        raise DiskFull


def check_name(name: str) -> str:
    """Normalize a file name: forward slashes, composed Unicode; raises InputError bad_file_name."""
    plain = unicodedata.normalize("NFC", name).replace("\\", "/").strip("/")
    parts = plain.split("/")
    if (
        not plain
        or len(plain) > 500
        or any(p.strip() in {"", ".", ".."} for p in parts)
        or _unprintable(plain)
    ):
        raise InputError(
            "bad_file_name", "A file's name has 1 to 500 printable characters and no '..' among its folders."
        )
    return plain


def _unprintable(name: str) -> bool:
    # control characters, lone surrogates, marks that reverse the text direction and disguise the extension,
    # and stand-ins for undecodable bytes; joiners are kept, as emoji need them
    return any(
        unicodedata.category(c) in {"Cc", "Cs"}
        or unicodedata.bidirectional(c) in _TURNING
        or c in "\u200e\u200f\u061c\ufffd"
        for c in name
    )


_TURNING: Final = frozenset(("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"))
