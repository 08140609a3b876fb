"""Unreferenced stored files: `trash/<when>/<space>/<sha256>`, retained for 30 days.

A folder `<when>` (UTC, 20260314T031500Z) has the layout of `blobs/`, so files can be restored manually. The
content is determined by names alone. In a folder each file is moved by one rename, so a crash leaves it in
either place, and `trash/list.txt` lists the files for users. In a bucket a file is copied, then removed.
"""

from __future__ import annotations

import datetime as dt
import re
import stat
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from sagittal.server.storage import fs

KEPT: Final = dt.timedelta(days=30)
"""Time for noticing that the wrong database was restored."""
_STAMP: Final = "%Y%m%dT%H%M%SZ"
_SPACE: Final = re.compile(r"[0-9a-f]{32}")
_NAME: Final = re.compile(r"[0-9a-f]{64}")

Address = tuple[str, str]
"""Space and name of a stored file."""


@dataclass(frozen=True)
class TrashedFile:
    """One file in the trash: its blob, size in bytes, and time of removal."""

    space: str
    name: str
    size: int
    since: dt.datetime

    @property
    def until(self) -> dt.datetime:
        """Time of permanent deletion."""
        return self.since + KEPT

    @property
    def way(self) -> str:
        """Path within the trash: `<when>/<space>/<sha256>`."""
        return f"{name_stamp(self.since)}/{self.space}/{self.name}"


class Trash(ABC):
    """Trash of a blob store; `place` describes its location to users."""

    place: str

    @abstractmethod
    def files(self) -> Iterator[TrashedFile]:
        """All files, oldest first; foreign files and those that disappear meanwhile are skipped."""

    @abstractmethod
    def prepare(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """Do the time-consuming part of `take`, which is called under a lock."""

    @abstractmethod
    def take(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """Move prepared files here; durable only after `settle`."""

    @abstractmethod
    def forget(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """Undo `prepare` for files not taken."""

    @abstractmethod
    def settle(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """Make the effects of `take` durable."""

    @abstractmethod
    def put_back(self, one: TrashedFile) -> None:
        """Durably restore a file to the blobs."""

    @abstractmethod
    def open(self, one: TrashedFile) -> BinaryIO:
        """Open unverified content; raises OSError, StoreAway."""

    @abstractmethod
    def remove(self, space: str, names: Iterable[str] | None = None) -> None:
        """Permanently and durably remove these files of a space; None = the whole space."""

    @abstractmethod
    def drop(self, trashed: Collection[TrashedFile]) -> None:
        """Permanently remove files."""

    def expire(self, now: dt.datetime) -> int:
        """Permanently remove expired files; return their number."""
        old = [one for one in self.files() if one.until <= now]
        if old:
            self.drop(old)
        return len(old)

    @abstractmethod
    def tidy(self) -> None:
        """Clean up after files have been removed."""


def name_stamp(time: dt.datetime) -> str:
    """Format `<when>`."""
    return time.astimezone(dt.UTC).strftime(_STAMP)


def parse_way(way: str, size: int) -> TrashedFile | None:
    """The file at `<when>/<space>/<sha256>`; None if the path is foreign."""
    stamp, _, tail = way.partition("/")
    space, _, name = tail.partition("/")
    since = _parse_stamp(stamp)
    if since is None or not (_SPACE.fullmatch(space) and _NAME.fullmatch(name)):
        return None
    return TrashedFile(space, name, size, since)


def _parse_stamp(name: str) -> dt.datetime | None:
    try:
        time = dt.datetime.strptime(name, _STAMP).replace(tzinfo=dt.UTC)
    except ValueError:
        return None
    return time if name_stamp(time) == name else None


class FolderTrash(Trash):
    """Trash in a folder, created with the first file.

    Parameters
    ----------
    blobs : folder of the stored files, on the same file system.
    """

    def __init__(self, root: Path, blobs: Path) -> None:
        self.root, self.place = root, str(root)
        self._blobs = blobs

    def path(self, one: TrashedFile) -> Path:
        """Path of a file."""
        return self.root / one.way

    def files(self) -> Iterator[TrashedFile]:
        """See Trash."""
        for stamp, since in self._stamps():
            for folder in _entries(stamp):
                if not _SPACE.fullmatch(folder.name):
                    continue
                for path in _entries(folder):
                    if _NAME.fullmatch(path.name) and (size := _size(path)) is not None:
                        yield TrashedFile(folder.name, path.name, size, since)

    def prepare(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """See Trash; a rename requires no preparation."""

    def take(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """See Trash."""
        for space, name in addresses:
            fs.move_file(self._blobs / space / name, self._folder(time) / space / name)

    def forget(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """See Trash; there is nothing to undo."""

    def settle(self, addresses: Collection[Address], time: dt.datetime) -> None:
        """See Trash; also writes the list."""
        if not addresses:
            return
        for space in sorted({space for space, _ in addresses}):
            fs.sync_folder(self._folder(time) / space)
            fs.sync_folder(self._blobs / space)
        self.write_list()

    def put_back(self, one: TrashedFile) -> None:
        """See Trash."""
        source, target = self.path(one), self._blobs / one.space / one.name
        fs.move_file(source, target)
        fs.sync_folder(target.parent)
        fs.sync_folder(source.parent)

    def open(self, one: TrashedFile) -> BinaryIO:
        """See Trash."""
        return self.path(one).open("rb")

    def remove(self, space: str, names: Iterable[str] | None = None) -> None:
        """See Trash."""
        selected = None if names is None else set(names)
        for stamp, _ in self._stamps():
            folder = stamp / space
            if folder.is_symlink() or not folder.is_dir():
                continue
            if selected is None:
                fs.remove_folder(folder)
            else:
                for name in selected:
                    fs.remove_file(folder / name)
                fs.sync_folder(folder)

    def drop(self, trashed: Collection[TrashedFile]) -> None:
        """See Trash."""
        for one in trashed:
            fs.remove_file(self.path(one))
        self.tidy()

    def tidy(self) -> None:
        """Remove empty folders and write the list."""
        for stamp, _ in self._stamps():
            for folder in (*_entries(stamp), stamp):
                if folder.is_dir() and not folder.is_symlink() and not _entries(folder):
                    fs.remove_folder(folder)
        self.write_list()

    def write_list(self) -> None:
        """Write `list.txt`: removal, expiry, size and path of every file."""
        if not self.root.is_dir():
            return
        lines = [
            f"{one.since:%Y-%m-%d %H:%M}Z  {one.until:%Y-%m-%d %H:%M}Z  {one.size:>12}  {one.way}\n"
            for one in self.files()
        ]
        head = "# Stored files that the database does not know: since, removed on, bytes, place.\n"
        fs.write_file(self.root / "list.txt", (head + "".join(lines)).encode())

    def _folder(self, time: dt.datetime) -> Path:
        return self.root / name_stamp(time)

    def _stamps(self) -> list[tuple[Path, dt.datetime]]:
        """Folders and their times, oldest first."""
        stamps = []
        for path in sorted(self.root.iterdir()) if self.root.is_dir() else ():
            since = _parse_stamp(path.name)
            if since is not None and path.is_dir() and not path.is_symlink():
                stamps.append((path, since))
        return stamps


def _entries(folder: Path) -> list[Path]:
    """Content of a folder, by name; empty if it is not a folder or has disappeared."""
    try:
        return [] if folder.is_symlink() else sorted(folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []


def _size(path: Path) -> int | None:
    """Size of a file in bytes; None if it is not a file or has disappeared."""
    try:
        status = path.lstat()
    except FileNotFoundError:
        return None
    return status.st_size if stat.S_ISREG(status.st_mode) else None
