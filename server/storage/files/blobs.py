"""Content-addressed files: `blobs/<space>/<sha256>`, immutable, verified at every read.

    blobs = open_blobs(settings)        # storage/blob_opening.py: a folder, or an S3-compatible bucket
    blob = blobs.put(space, content)    # durable on return

A space is a patient's id. Identical content of two patients is stored twice, so that an upload cannot reveal
the files of another patient (no existence oracle) and erasing a patient erases a space.

An existing file is always overwritten by an equal one: this costs a write, but repairs a damaged file and
renews its time, so that the sweep of unreferenced files cannot remove a file about to be referenced.
"""

from __future__ import annotations

import hashlib
import re
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, ClassVar, Final, Self

from sagittal.core.errors import SagittalError
from sagittal.server.storage import fs
from sagittal.server.storage.files.trash import Trash

PIECE: Final = 1 << 20
"""Bytes of a file in memory at a time."""
_HEX32 = re.compile(r"[0-9a-f]{32}")
_HEX64 = re.compile(r"[0-9a-f]{64}")
INCOMING = "incoming"
"""Space of files being received, or left by a dead process; always a local folder."""


class IntegrityError(SagittalError):
    """A stored file is missing or its content has changed."""

    status = 503


class StoreAway(SagittalError):  # noqa: N818 - says what is the matter
    """The store is unavailable: the state of the file is unknown, and retrying may help.

    Parameters
    ----------
    refuses : access is denied, which requires an administrator. detail : for the administrator.
    """

    status = 503

    def __init__(self, detail: str, *, refuses: bool) -> None:
        super().__init__("store_refuses" if refuses else "store_away", REFUSES if refuses else AWAY)
        self.detail, self.refuses = detail, refuses

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild_away, (self.detail, self.refuses)


AWAY: Final = "The bucket of stored files cannot be reached; nothing was changed."
REFUSES: Final = "The bucket of stored files refuses the server; nothing was changed."


@dataclass(frozen=True)
class Blob:
    """A stored file: hash and size in bytes of its content."""

    sha256: str
    size: int


@dataclass(frozen=True)
class BlobFile:
    """A file listed in the store, referenced or not; `age_s` since it was written."""

    space: str
    name: str
    age_s: float


class BlobStore(ABC):
    """Store of all blobs.

    Parameters
    ----------
    incoming : local folder of files being received; created if absent. trash : unreferenced files.
    place : description of the location for users.
    """

    moved_at_once: ClassVar[int]
    """Files moved to the trash per write lock, which blocks other writers."""

    def __init__(self, incoming: Path, trash: Trash, place: str) -> None:
        self.incoming, self.trash, self.place = incoming, trash, place
        self._locks = incoming.parent.with_name("part-locks")
        fs.make_folder(incoming)

    @abstractmethod
    def receive(self, space: str, limit: int | None = None) -> Receiver:
        """Receive a file in chunks: `with store.receive(pid, limit) as r: r.write(chunk); blob =
        r.keep()`.
        """

    @abstractmethod
    def adopt(self, space: str, path: Path, sha256: str) -> None:
        """Durably store a synced file of `incoming` with this content.

        A folder moves it; with a bucket the caller removes it once its row is written.
        """

    def put(self, space: str, content: bytes) -> Blob:
        """Store bytes durably."""
        with self.receive(space) as receiver:
            receiver.write(content)
            return receiver.keep()

    def part(self, upload_id: str) -> Path:
        """Path of an incomplete file that is uploaded in parts (services/uploads.py)."""
        return self.incoming / self.name_part(upload_id)

    @staticmethod
    def name_part(upload_id: str) -> str:
        """Name of an incomplete file."""
        if not _HEX32.fullmatch(upload_id):
            raise ValueError(f"'{upload_id}' is not the id of an upload.")
        return f"{upload_id}.part"

    def hold_part(self, upload_id: str) -> AbstractContextManager[None]:
        """Lock a part for appending or renaming, across all processes that share the folder.

        Locks are shared by several parts to limit the number of lock files.
        """
        fs.make_folder(self._locks)
        return fs.hold_lock(self._locks / f"{self.name_part(upload_id)[:2]}.lock")

    def lock_sweep(self) -> fs.Lock:
        """Lock for a sweep, across all processes that share the folder; raises fs.LockedError."""
        fs.make_folder(self._locks)
        return fs.Lock(self._locks / "sweep.lock", "a sweep")

    @abstractmethod
    def probe(self) -> None:
        """Write and remove a test file; raises OSError, StoreAway."""

    def read(self, space: str, sha256: str) -> bytes:
        """Return the verified bytes; raise IntegrityError (blob_missing, blob_damaged), StoreAway."""
        content = self._load(space, sha256)
        if content is None:
            raise make_missing(sha256)
        if hashlib.sha256(content).hexdigest() != sha256:
            raise make_damaged(sha256)
        return content

    def open(self, space: str, sha256: str) -> BinaryIO:
        """Open the content, fully verified beforehand; raises like `read`."""
        file = self.open_unverified(space, sha256)
        if file is None:
            raise make_missing(sha256)
        if digest_open(file) != sha256:
            file.close()
            raise make_damaged(sha256)
        file.seek(0)
        return file

    @abstractmethod
    def _load(self, space: str, sha256: str) -> bytes | None:
        """Unverified bytes; None = the file is missing."""

    @abstractmethod
    def open_unverified(self, space: str, sha256: str) -> BinaryIO | None:
        """Open the content for seeking, unverified; None = the file is missing."""

    @abstractmethod
    def read_part(self, space: str, sha256: str, start: int, stop: int) -> bytes:
        """Bytes from `start` up to `stop`, unverified.

        Raises
        ------
        IntegrityError
            blob_missing; blob_damaged if the file is shorter.
        StoreAway
            the store cannot be reached.
        """

    @abstractmethod
    def has(self, space: str, sha256: str) -> bool:
        """Whether the file exists; uses a short timeout, since a write lock may be held."""

    def require(self, space: str, sha256: str) -> None:
        """Raise IntegrityError if the file is missing; call in the transaction that refers to it."""
        if not self.has(space, sha256):
            raise make_missing(sha256)

    def files(self) -> Iterator[BlobFile]:
        """All files in the store, including partially received ones (their space is INCOMING)."""
        for path in sorted(self.incoming.iterdir()):
            age_s = age_of(path)
            if age_s is not None:
                yield BlobFile(INCOMING, path.name, age_s)
        yield from self._stored()

    @abstractmethod
    def _stored(self) -> Iterator[BlobFile]:
        """All completely stored files."""

    def is_older(self, one: BlobFile, age_s: float) -> bool:
        """Whether a listed file still exists and has not been rewritten since."""
        age = age_of(self.incoming / one.name) if one.space == INCOMING else self._age_of(one)
        return age is not None and age >= age_s

    @abstractmethod
    def _age_of(self, one: BlobFile) -> float | None:
        """Seconds since a stored file was written; None = it is missing."""

    def discard(self, blob_files: Iterable[BlobFile]) -> None:
        """Permanently remove listed files."""
        of_spaces: dict[str, list[str]] = {}
        for one in blob_files:
            if one.space == INCOMING:
                fs.remove_file(self.incoming / one.name)
            else:
                of_spaces.setdefault(one.space, []).append(one.name)
        for space, names in of_spaces.items():
            self.remove(space, *names)

    @abstractmethod
    def remove(self, space: str, *names: str) -> None:
        """Permanently remove files; no error if absent. Uses a short timeout like `has`."""

    @abstractmethod
    def erase(self, space: str) -> None:
        """Remove an entire space."""

    @abstractmethod
    def settle(self, spaces: Iterable[str]) -> None:
        """Make removals from these spaces durable."""


class Receiver(ABC):
    """A blob being received into a local file."""

    def __init__(self, incoming: Path, limit: int | None) -> None:
        self._file = fs.IncomingFile(incoming, limit)

    def write(self, data: bytes) -> None:
        """Append bytes; raises fs.SizeLimitError if the limit is exceeded."""
        self._file.write(data)

    @abstractmethod
    def keep(self) -> Blob:
        """Move the file to its final name, durably. Raises StoreAway."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.__exit__(None, None, None)


def digest_open(file: BinaryIO) -> str:
    """Hexadecimal SHA-256 of an open file from its current position, read in parts."""
    digest = hashlib.sha256()
    while piece := file.read(PIECE):
        digest.update(piece)
    return digest.hexdigest()


def check_address(space: str, sha256: str) -> str:
    """`<space>/<sha256>` of a blob; raises ValueError if invalid."""
    if not (is_space(space) and _HEX64.fullmatch(sha256)):
        raise ValueError(f"'{space}/{sha256}' is not the address of a blob.")
    return f"{space}/{sha256}"


def is_space(name: str) -> bool:
    """Whether the name is valid for a space."""
    return _HEX32.fullmatch(name) is not None


def age_of(path: Path) -> float | None:
    """Seconds since a local file was written; None = it is missing."""
    try:
        return time.time() - path.stat().st_mtime
    except FileNotFoundError:
        return None


def make_damaged(sha256: str) -> IntegrityError:
    """Error for a file whose content has changed."""
    return IntegrityError(
        "blob_damaged",
        f"The stored file {sha256[:12]}… has changed on the disk; its content is not used. "
        "Restore it from a backup or upload the original again.",
    )


def make_missing(sha256: str) -> IntegrityError:
    """Error for a missing file."""
    return IntegrityError(
        "blob_missing",
        f"The stored file {sha256[:12]}… is not there. "
        "Restore it from a backup or upload the original again.",
    )


def _rebuild_away(detail: str, refuses: bool) -> StoreAway:
    return StoreAway(detail, refuses=refuses)
