"""Blobs in an S3-compatible bucket: objects `<prefix>/blobs/<space>/<sha256>`.

A file is received into the local folder `incoming` and uploaded from there; it is acknowledged when the
bucket has confirmed it. Any failure to reach the bucket raises StoreAway within seconds, so that files are
not mistaken for missing. One prefix belongs to one clinic.
"""

from __future__ import annotations

import contextlib
import datetime as dt
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, ClassVar, Final

from sagittal.server.storage import fs
from sagittal.server.storage.files.blobs import (
    Blob,
    BlobFile,
    BlobStore,
    Receiver,
    check_address,
    make_damaged,
    make_missing,
)
from sagittal.server.storage.files.s3_bucket import S3Bucket
from sagittal.server.storage.files.trash import Address, Trash, TrashedFile, name_stamp, parse_way

SILENCE_S: Final = 15.0
"""Timeout for the next response of the store, and for uploading part of a file."""
BRIEF_S: Final = 5.0
"""Likewise for requests under a lock, which are retried once."""
_BLOBS, _TRASH, _PROBE = "blobs/", "trash/", "probe"


class BucketBlobs(BlobStore):
    """All blobs of a clinic in a bucket.

    Parameters
    ----------
    url : s3://name/prefix. incoming : local folder in which files are received.
    note : called when the bucket has stored a file, before it is acknowledged.

    Raises
    ------
    SettingsError
        the library is not installed, or the endpoint cannot be used.
    """

    moved_at_once: ClassVar[int] = 20

    def __init__(self, url: str, incoming: Path, note: Callable[[], None] = lambda: None) -> None:
        self._note = note
        self._bucket = S3Bucket(url, SILENCE_S, 2)
        self._brief = S3Bucket(url, BRIEF_S, 1)
        self.trash: BucketTrash
        super().__init__(incoming, BucketTrash(self._bucket, self._brief, incoming), url)

    def receive(self, space: str, limit: int | None = None) -> Receiver:
        """See BlobStore."""
        check_address(space, "0" * 64)
        return _BucketReceiver(self, space, limit)

    def adopt(self, space: str, path: Path, sha256: str) -> None:
        """See BlobStore."""
        self._bucket.put(_key(space, sha256), path)
        self._note()

    def probe(self) -> None:
        """See BlobStore; tests all operations that a clinic requires of the bucket."""
        self._brief.put(_PROBE, b"probe")
        self._brief.load(_PROBE)
        next(self._brief.list(_BLOBS), None)
        self._brief.delete([_PROBE])
        # received files wait here
        with fs.IncomingFile(self.incoming) as file:
            file.write(bytes(4096))

    def keeps_versions(self) -> bool:
        """Whether the bucket keeps versions of removed objects, including erased patients."""
        version = self._brief.put(_PROBE, b"probe")
        self._brief.delete([_PROBE])
        return version not in {None, "null"}

    def is_empty(self) -> bool:
        """Whether there are no objects under the prefix, except the remains of a killed `probe`."""
        return all(entry["path"] == _PROBE for entry in self._bucket.list(""))

    def _load(self, space: str, sha256: str) -> bytes | None:
        return self._bucket.load(_key(space, sha256))

    def open_unverified(self, space: str, sha256: str) -> BinaryIO | None:
        """See BlobStore."""
        return self._bucket.fetch(_key(space, sha256), self.incoming)

    def read_part(self, space: str, sha256: str, start: int, stop: int) -> bytes:
        """See BlobStore."""
        content = self._bucket.load_part(_key(space, sha256), start, stop)
        if content is None:
            raise make_missing(sha256)
        if len(content) != stop - start:
            raise make_damaged(sha256)
        return content

    def has(self, space: str, sha256: str) -> bool:
        """See BlobStore."""
        return self._brief.find(_key(space, sha256)) is not None

    def _stored(self) -> Iterator[BlobFile]:
        for entry in self._bucket.list(_BLOBS):
            space, _, name = entry["path"].removeprefix(_BLOBS).partition("/")
            with contextlib.suppress(ValueError):  # foreign objects are skipped
                check_address(space, name)
                yield BlobFile(space, name, _age_s(entry["last_modified"]))

    def _age_of(self, one: BlobFile) -> float | None:
        entry = self._brief.find(f"{_BLOBS}{one.space}/{one.name}")
        return None if entry is None else _age_s(entry["last_modified"])

    def remove(self, space: str, *names: str) -> None:
        """See BlobStore."""
        self._brief.delete([_key(space, name) for name in names])

    def erase(self, space: str) -> None:
        """See BlobStore."""
        folder = _key(space, "0" * 64).rpartition("/")[0]
        self._bucket.delete([entry["path"] for entry in self._bucket.list(f"{folder}/")])

    def settle(self, spaces: Iterable[str]) -> None:
        """See BlobStore; responses of the bucket are final."""
        fs.sync_folder(self.incoming)


class BucketTrash(Trash):
    """Objects `<prefix>/trash/<when>/<space>/<sha256>`."""

    def __init__(self, bucket: S3Bucket, brief: S3Bucket, scratch: Path) -> None:
        self._bucket, self._brief, self._scratch = bucket, brief, scratch
        self.place = f"{bucket.url}/{_TRASH.rstrip('/')}"

    def files(self) -> Iterator[TrashedFile]:
        """See Trash."""
        for entry in self._bucket.list(_TRASH):
            one = parse_way(entry["path"].removeprefix(_TRASH), entry["size"])
            if one is not None:
                yield one

    def prepare(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """See Trash; creates the copies."""
        for space, name in addresses:
            self._bucket.copy(f"{_BLOBS}{space}/{name}", _way(space, name, time))

    def take(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """See Trash."""
        self._brief.delete([f"{_BLOBS}{space}/{name}" for space, name in addresses])

    def forget(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """See Trash; deletes the copies."""
        self._bucket.delete([_way(space, name, time) for space, name in addresses])

    def settle(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """See Trash; responses of the bucket are final."""

    def receive(self, one: TrashedFile, path: Path) -> None:
        """Upload a local file from the trash of a folder."""
        self._bucket.put(_TRASH + one.way, path)

    def put_back(self, one: TrashedFile) -> None:
        """See Trash."""
        self._bucket.copy(_TRASH + one.way, _key(one.space, one.name))
        self._bucket.delete([_TRASH + one.way])

    def open(self, one: TrashedFile) -> BinaryIO:
        """See Trash."""
        file = self._bucket.fetch(_TRASH + one.way, self._scratch)
        if file is None:
            raise FileNotFoundError(2, "it is gone", f"{self.place}/{one.way}")
        return file

    def remove(self, space: str, names: Iterable[str] | None = None) -> None:
        """See Trash."""
        selected = None if names is None else set(names)
        self.drop([f for f in self.files() if f.space == space and (selected is None or f.name in selected)])

    def drop(self, trashed: Collection[TrashedFile]) -> None:
        """See Trash."""
        self._bucket.delete([_TRASH + one.way for one in trashed])

    def tidy(self) -> None:
        """See Trash; there are no folders."""


class _BucketReceiver(Receiver):
    def __init__(self, blobs: BucketBlobs, space: str, limit: int | None) -> None:
        super().__init__(blobs.incoming, limit)
        self._blobs, self._space = blobs, space

    def keep(self) -> Blob:
        blob = Blob(self._file.sha256, self._file.size)
        self._blobs.adopt(self._space, self._file.path, blob.sha256)
        return blob


def _key(space: str, sha256: str) -> str:
    return _BLOBS + check_address(space, sha256)


def _way(space: str, name: str, time: dt.datetime) -> str:
    return f"{_TRASH}{name_stamp(time)}/{space}/{name}"


def _age_s(time: dt.datetime) -> float:
    return (dt.datetime.now(dt.UTC) - time).total_seconds()
