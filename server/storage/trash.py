"""Stored files that nothing refers to any more: `trash/<when>/<space>/<sha256>`, kept for 30 days.

A folder `<when>` (UTC, 20260314T031500Z) has the shape of `blobs/`, so files can be put back by hand. What
lies there is known from the folders alone: a file is moved by one rename, a crash leaves it here or there.
`trash/list.txt` says the same for people and is written anew after every change.
"""

from __future__ import annotations

import datetime as dt
import re
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from server.storage import fs
from server.storage.blobs import BlobFile

KEPT: Final = dt.timedelta(days=30)
"""Time in which somebody notices that the wrong database was put back."""
_STAMP: Final = "%Y%m%dT%H%M%SZ"
_SPACE: Final = re.compile(r"[0-9a-f]{32}")
_NAME: Final = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class TrashedFile:
    """One file in the trash: which blob it was, its length in bytes, and since when it lies there."""

    space: str
    name: str
    path: Path
    size: int
    since: dt.datetime

    @property
    def until(self) -> dt.datetime:
        """When it is removed for good."""
        return self.since + KEPT


class Trash:
    """The folder; made when the first file comes."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def files(self) -> Iterator[TrashedFile]:
        """Every file, the oldest first; what is not ours is passed over, and what goes meanwhile."""
        for stamp, since in self._stamps():
            for folder in _entries(stamp):
                if not _SPACE.fullmatch(folder.name):
                    continue
                for path in _entries(folder):
                    if _NAME.fullmatch(path.name) and (size := _size(path)) is not None:
                        yield TrashedFile(folder.name, path.name, path, size, since)

    def take(self, found: Iterable[BlobFile], at: dt.datetime) -> None:
        """Move files here; survives a power cut only after `settle` with the same."""
        for stored in found:
            fs.move_file(stored.path, self._folder(at) / stored.space / stored.name)

    def settle(self, found: Iterable[BlobFile], at: dt.datetime) -> None:
        """Make what `take` did survive a power cut, and write the list."""
        spaces = {(stored.path.parent, self._folder(at) / stored.space) for stored in found}
        for source, target in sorted(spaces):
            fs.sync_folder(target)
            fs.sync_folder(source)
        self.write_list()

    def put_back(self, one: TrashedFile, target: Path) -> None:
        """Give a file its place among the blobs again, durably."""
        fs.move_file(one.path, target)
        fs.sync_folder(target.parent)
        fs.sync_folder(one.path.parent)

    def remove(self, space: str, names: Iterable[str] | None = None) -> None:
        """Remove these files of a space for good, durably; None = the whole space."""
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

    def expire(self, now: dt.datetime) -> int:
        """Remove for good what has lain here long enough; return how many files."""
        old = [one for one in self.files() if one.until <= now]
        for one in old:
            fs.remove_file(one.path)
        if old:
            self.tidy()
        return len(old)

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
            f"{one.since:%Y-%m-%d %H:%M}Z  {one.until:%Y-%m-%d %H:%M}Z  {one.size:>12}  "
            f"{one.path.relative_to(self.root)}\n"
            for one in self.files()
        ]
        head = "# Stored files that the database does not know: since, removed on, bytes, place.\n"
        fs.write_file(self.root / "list.txt", (head + "".join(lines)).encode())

    def _folder(self, at: dt.datetime) -> Path:
        return self.root / at.astimezone(dt.UTC).strftime(_STAMP)

    def _stamps(self) -> list[tuple[Path, dt.datetime]]:
        """Folders and their times, the oldest first."""
        found = []
        for path in sorted(self.root.iterdir()) if self.root.is_dir() else ():
            try:
                since = dt.datetime.strptime(path.name, _STAMP).replace(tzinfo=dt.UTC)
            except ValueError:
                continue
            if path.is_dir() and not path.is_symlink():
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
