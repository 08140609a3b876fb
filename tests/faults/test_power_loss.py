"""Power loss while publishing: the real code on a model of a disk, every state it may be found in."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.storage import fs

CONTENT = b"0123456789"


class ModelDisk(fs.System):
    """What a file system may keep when the power goes: only what was synced is sure.

    A file's unsynced bytes may be there, half there or zero; a folder's unsynced changes may have reached the
    disk up to any prefix of their order. `states` lists all that the disk may show after the last call.
    """

    def __init__(self) -> None:
        self._files: dict[int, bytearray] = {}  # inode → content in memory
        self._synced: dict[int, bytes] = {}  # inode → content surely on the disk
        self._names: dict[Path, int] = {}  # as the running system sees it
        self._durable: dict[Path, int] = {}  # names surely on the disk
        self._pending: list[tuple[Path, Path | None, int | None]] = []  # (name, renamed from, inode or gone)
        self._open: dict[int, Path | int] = {}
        self._next = itertools.count(100)
        self.history: list[list[dict[Path, bytes]]] = []

    def open(self, path: Path, flags: int) -> int:
        fd = next(self._next)
        if flags & os.O_DIRECTORY:
            self._open[fd] = path
            return fd
        inode = next(self._next)
        self._files[inode], self._names[path] = bytearray(), inode
        self._synced[inode] = b""
        self._pending.append((path, None, inode))
        self._open[fd] = inode
        self._snap()
        return fd

    def write(self, fd: int, data: bytes | memoryview) -> int:
        inode = self._open[fd]
        assert isinstance(inode, int)
        self._files[inode] += bytes(data)
        self._snap()
        return len(data)

    def fsync(self, fd: int) -> None:
        thing = self._open[fd]
        if isinstance(thing, int):
            self._synced[thing] = bytes(self._files[thing])
        else:
            for change in [p for p in self._pending if p[0].parent == thing]:
                self._apply(self._durable, change)
                self._pending.remove(change)
        self._snap()

    def close(self, fd: int) -> None:
        del self._open[fd]

    def replace(self, source: Path, target: Path) -> None:
        inode = self._names.pop(source)
        self._names[target] = inode
        self._pending.append((target, source, inode))
        self._snap()

    def unlink(self, path: Path) -> None:
        if self._names.pop(path, None) is not None:
            self._pending.append((path, None, None))
            self._snap()

    def _apply(self, names: dict[Path, int], change: tuple[Path, Path | None, int | None]) -> None:
        target, source, inode = change
        if source is not None:
            names.pop(source, None)
        if inode is None:
            names.pop(target, None)
        else:
            names[target] = inode

    def _snap(self) -> None:
        self.history.append(list(self.states()))

    def states(self) -> Iterator[dict[Path, bytes]]:
        for kept in range(len(self._pending) + 1):
            names = dict(self._durable)
            for change in self._pending[:kept]:
                self._apply(names, change)
            choices = []
            for path, inode in names.items():
                full, sure = bytes(self._files[inode]), self._synced[inode]
                lost = len(full) - len(sure)
                contents = {full, sure, sure + full[len(sure) : len(sure) + lost // 2], sure + bytes(lost)}
                choices.append([(path, content) for content in sorted(contents)])
            for state in itertools.product(*choices):
                yield dict(state)


def publish(disk: ModelDisk, monkeypatch: pytest.MonkeyPatch, *, order: str) -> list[list[dict[Path, bytes]]]:
    """Publish a file and its row; returns the possible states from the moment the row is committed."""
    monkeypatch.setattr(fs, "system", disk)
    target = Path("/blobs/p/sha")
    if order == "row first":
        begin = 0
        fs.write_file(target, CONTENT)
    else:
        fs.write_file(target, CONTENT)
        begin = len(disk.history) - 1
    return disk.history[begin:]


def broken(states: list[list[dict[Path, bytes]]]) -> int:
    """In how many states a committed row refers to a missing or damaged file."""
    return sum(state.get(Path("/blobs/p/sha")) != CONTENT for moment in states for state in moment)


def test_a_committed_row_always_has_its_whole_file(monkeypatch: pytest.MonkeyPatch) -> None:
    disk = ModelDisk()
    states = publish(disk, monkeypatch, order="file first")
    assert states
    assert broken(states) == 0
    assert sum(map(len, disk.history)) > 10


def test_a_name_never_shows_a_part_of_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    disk = ModelDisk()
    publish(disk, monkeypatch, order="file first")
    shown = {state.get(Path("/blobs/p/sha")) for moment in disk.history for state in moment}
    assert shown == {None, CONTENT}


def test_the_model_sees_the_mistakes_it_is_there_for(monkeypatch: pytest.MonkeyPatch) -> None:
    assert broken(publish(ModelDisk(), monkeypatch, order="row first")) > 0

    class NoFileSync(ModelDisk):
        def fsync(self, fd: int) -> None:
            if not isinstance(self._open[fd], int):
                super().fsync(fd)

    class NoFolderSync(ModelDisk):
        def fsync(self, fd: int) -> None:
            if isinstance(self._open[fd], int):
                super().fsync(fd)

    for careless in (NoFileSync(), NoFolderSync()):
        assert broken(publish(careless, monkeypatch, order="file first")) > 0
