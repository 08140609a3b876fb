"""Blobs in a local folder: `blobs/<space>/<sha256>`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, ClassVar

from sagittal.server.storage import fs
from sagittal.server.storage.files.blobs import (
    INCOMING,
    Blob,
    BlobFile,
    BlobStore,
    Receiver,
    age_of,
    check_address,
    is_space,
    make_damaged,
    make_missing,
)
from sagittal.server.storage.files.trash import FolderTrash


class FolderBlobs(BlobStore):
    """Folder of all blobs.

    Parameters
    ----------
    root : created if absent; the trash is in the same parent folder.
    """

    moved_at_once: ClassVar[int] = 100

    def __init__(self, root: Path) -> None:
        self.trash: FolderTrash
        super().__init__(root / INCOMING, FolderTrash(root.parent / "trash", root), str(root))
        self.root = root

    def receive(self, space: str, limit: int | None = None) -> Receiver:
        """See BlobStore."""
        return _FolderReceiver(self._folder(space), self.incoming, limit)

    def adopt(self, space: str, path: Path, sha256: str) -> None:
        """See BlobStore."""
        target = self.path(space, sha256)
        fs.move_file(path, target)
        for folder in {target.parent, path.parent}:
            fs.sync_folder(folder)

    def probe(self) -> None:
        """See BlobStore."""
        with self.receive("0" * 32) as receiver:
            receiver.write(bytes(4096))

    def _load(self, space: str, sha256: str) -> bytes | None:
        try:
            return self.path(space, sha256).read_bytes()
        except FileNotFoundError:
            return None

    def open_unverified(self, space: str, sha256: str) -> BinaryIO | None:
        """See BlobStore."""
        try:
            return self.path(space, sha256).open("rb")
        except FileNotFoundError:
            return None

    def read_part(self, space: str, sha256: str, start: int, stop: int) -> bytes:
        """See BlobStore."""
        file = self.open_unverified(space, sha256)
        if file is None:
            raise make_missing(sha256)
        with file:
            file.seek(start)
            content = file.read(stop - start)
        if len(content) != stop - start:
            raise make_damaged(sha256)
        return content

    def has(self, space: str, sha256: str) -> bool:
        """See BlobStore."""
        return self.path(space, sha256).is_file()

    def path(self, space: str, sha256: str) -> Path:
        """Path of a blob."""
        return self.root / check_address(space, sha256)

    def find_path(self, one: BlobFile) -> Path:
        """Path of a listed file, whose name may be arbitrary."""
        return self.root / one.space / one.name

    def _stored(self) -> Iterator[BlobFile]:
        for folder in sorted(self.root.iterdir()):
            if folder.is_dir() and is_space(folder.name):
                for path in sorted(folder.iterdir()):
                    age_s = age_of(path)
                    if age_s is not None:
                        yield BlobFile(folder.name, path.name, age_s)

    def _age_of(self, one: BlobFile) -> float | None:
        return age_of(self.find_path(one))

    def discard(self, blob_files: Iterable[BlobFile]) -> None:
        """See BlobStore; names may be arbitrary."""
        for one in blob_files:
            fs.remove_file(self.find_path(one))

    def remove(self, space: str, *names: str) -> None:
        """See BlobStore."""
        for name in names:
            fs.remove_file(self.path(space, name))

    def erase(self, space: str) -> None:
        """See BlobStore."""
        fs.remove_folder(self._folder(space))

    def settle(self, spaces: Iterable[str]) -> None:
        """See BlobStore."""
        for folder in (self.root, *map(self._folder, spaces)):
            with contextlib.suppress(FileNotFoundError):
                fs.sync_folder(folder)

    def _folder(self, space: str) -> Path:
        return self.path(space, "0" * 64).parent


class _FolderReceiver(Receiver):
    def __init__(self, target: Path, incoming: Path, limit: int | None) -> None:
        super().__init__(incoming, limit)
        self._target = target

    def keep(self) -> Blob:
        fs.make_folder(self._target)
        self._file.keep(self._target / self._file.sha256)
        return Blob(self._file.sha256, self._file.size)
