"""Stored files that nothing refers to any more: `trash/<when>/<space>/<sha256>`, kept for 30 days.

A folder `<when>` (UTC, 20260314T031500Z) has the shape of `blobs/`, so files can be put back by hand. What
lies there is known from the names alone. In a folder a file is moved by one rename, a crash leaves it here or
there, and `trash/list.txt` says the same for people. In a bucket it is copied, then removed.
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
"""Time in which somebody notices that the wrong database was put back."""
_STAMP: Final = "%Y%m%dT%H%M%SZ"
_SPACE: Final = re.compile(r"[0-9a-f]{32}")
_NAME: Final = re.compile(r"[0-9a-f]{64}")

Address = tuple[str, str]
"""Space and name of a stored file."""


@dataclass(frozen=True)
class TrashedFile:
    """One file in the trash: which blob it was, its length in bytes, and since when it lies there."""

    space: str
    name: str
    size: int
    since: dt.datetime

    @property
    def until(self) -> dt.datetime:
        """When it is removed for good."""
        return self.since + KEPT

    @property
    def way(self) -> str:
        """Where it lies within the trash: `<when>/<space>/<sha256>`."""
        return f"{name_stamp(self.since)}/{self.space}/{self.name}"


class Trash(ABC):
    """All of it; `place` says to people where it is."""

    place: str

    @abstractmethod
    def files(self) -> Iterator[TrashedFile]:
        """Every file, the oldest first; what is not ours is passed over, and what goes meanwhile."""

    @abstractmethod
    def prepare(self, found: Collection[Address], at: dt.datetime) -> None:
        """Do what takes time before `take`, which is called under a lock."""

    @abstractmethod
    def take(self, found: Collection[Address], at: dt.datetime) -> None:
        """Move stored files here, all of them prepared; survives a power cut only after `settle`."""

    @abstractmethod
    def forget(self, found: Collection[Address], at: dt.datetime) -> None:
        """Undo `prepare` of what was not taken."""

    @abstractmethod
    def settle(self, found: Collection[Address], at: dt.datetime) -> None:
        """Make what `take` did survive a power cut."""

    @abstractmethod
    def put_back(self, one: TrashedFile) -> None:
        """Give a file its place among the blobs again, durably."""

    @abstractmethod
    def open(self, one: TrashedFile) -> BinaryIO:
        """Its bytes as they are; raises OSError, StoreAway."""

    @abstractmethod
    def remove(self, space: str, names: Iterable[str] | None = None) -> None:
        """Remove these files of a space for good, durably; None = the whole space."""

    @abstractmethod
    def drop(self, found: Collection[TrashedFile]) -> None:
        """Remove files for good."""

    def expire(self, now: dt.datetime) -> int:
        """Remove for good what has lain here long enough; return how many files."""
        old = [one for one in self.files() if one.until <= now]
        if old:
            self.drop(old)
        return len(old)

    @abstractmethod
    def tidy(self) -> None:
        """Put things in order after files have gone."""


def name_stamp(at: dt.datetime) -> str:
    """`<when>`."""
    return at.astimezone(dt.UTC).strftime(_STAMP)


def parse_way(way: str, size: int) -> TrashedFile | None:
    """The file at `<when>/<space>/<sha256>`; None when it is none of ours."""
    stamp, _, rest = way.partition("/")
    space, _, name = rest.partition("/")
    since = _parse_stamp(stamp)
    if since is None or not (_SPACE.fullmatch(space) and _NAME.fullmatch(name)):
        return None
    return TrashedFile(space, name, size, since)


def _parse_stamp(name: str) -> dt.datetime | None:
    try:
        at = dt.datetime.strptime(name, _STAMP).replace(tzinfo=dt.UTC)
    except ValueError:
        return None
    return at if name_stamp(at) == name else None


class FolderTrash(Trash):
    """The folder; made when the first file comes.

    Parameters
    ----------
    blobs : the folder that files come from, on the same file system.
    """

    def __init__(self, root: Path, blobs: Path) -> None:
        self.root, self.place = root, str(root)
        self._blobs = blobs

    def path(self, one: TrashedFile) -> Path:
        """Where a file lies."""
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

    def prepare(self, found: Collection[Address], at: dt.datetime) -> None:
        """See Trash; a rename needs nothing."""

    def take(self, found: Collection[Address], at: dt.datetime) -> None:
        """See Trash."""
        for space, name in found:
            fs.move_file(self._blobs / space / name, self._folder(at) / space / name)

    def forget(self, found: Collection[Address], at: dt.datetime) -> None:
        """See Trash; nothing was done."""

    def settle(self, found: Collection[Address], at: dt.datetime) -> None:
        """See Trash; writes the list too."""
        if not found:
            return
        for space in sorted({space for space, _ in found}):
            fs.sync_folder(self._folder(at) / space)
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
        wanted = None if names is None else set(names)
        for stamp, _ in self._stamps():
            folder = stamp / space
            if folder.is_symlink() or not folder.is_dir():
                continue
            if wanted is None:
                fs.remove_folder(folder)
            else:
                for name in wanted:
                    fs.remove_file(folder / name)
                fs.sync_folder(folder)

    def drop(self, found: Collection[TrashedFile]) -> None:
        """See Trash."""
        for one in found:
            fs.remove_file(self.path(one))
        self.tidy()

    def tidy(self) -> None:
        """Remove empty folders and write the list, after files have gone."""
        for stamp, _ in self._stamps():
            for folder in (*_entries(stamp), stamp):
                if folder.is_dir() and not folder.is_symlink() and not _entries(folder):
                    fs.remove_folder(folder)
        self.write_list()

    def write_list(self) -> None:
        """Write `list.txt`: since, until, bytes and place of every file."""
        if not self.root.is_dir():
            return
        lines = [
            f"{one.since:%Y-%m-%d %H:%M}Z  {one.until:%Y-%m-%d %H:%M}Z  {one.size:>12}  {one.way}\n"
            for one in self.files()
        ]
        head = "# Stored files that the database does not know: since, removed on, bytes, place.\n"
        fs.write_file(self.root / "list.txt", (head + "".join(lines)).encode())

    def _folder(self, at: dt.datetime) -> Path:
        return self.root / name_stamp(at)

    def _stamps(self) -> list[tuple[Path, dt.datetime]]:
        """Folders and their times, the oldest first."""
        found = []
        for path in sorted(self.root.iterdir()) if self.root.is_dir() else ():
            since = _parse_stamp(path.name)
            if since is not None and path.is_dir() and not path.is_symlink():
                found.append((path, since))
        return found


def _entries(folder: Path) -> list[Path]:
    """What lies in a folder, by name; nothing when it is none or has gone."""
    try:
        return [] if folder.is_symlink() else sorted(folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []


def _size(path: Path) -> int | None:
    """Bytes of a file; None when it is none or has gone."""
    try:
        found = path.lstat()
    except FileNotFoundError:
        return None
    return found.st_size if stat.S_ISREG(found.st_mode) else None
