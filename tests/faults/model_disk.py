"""Model of a disk that guarantees synced data only: all states a power cut may leave."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path

from sagittal.server.storage import fs


class ModelDisk(fs.System):
    """File system that guarantees synced data only.

    Unsynced bytes may be present, partial or zero; unsynced changes of a folder may have been written up to
    any prefix of their order; a truncation may be missing. `states` enumerates the possible contents after
    the last call.
    """

    def __init__(self) -> None:
        self._files: dict[int, bytearray] = {}  # inode → content in memory
        self._synced: dict[int, bytes] = {}  # inode → content surely on the disk
        self._before: dict[int, list[bytes]] = {}  # inode → what unsynced cuts have cut
        self._names: dict[Path, int] = {}  # as the running system sees it
        self._durable: dict[Path, int] = {}  # names surely on the disk
        self._pending: list[tuple[Path, Path | None, int | None]] = []  # (name, renamed from, inode or gone)
        self._open: dict[int, Path | int] = {}
        self._next = itertools.count(100)
        self.history: list[list[dict[Path, bytes]]] = []

    def put(self, path: Path, content: bytes) -> None:
        """A file that is surely on the disk."""
        inode = next(self._next)
        self._files[inode], self._synced[inode] = bytearray(content), content
        self._names[path] = self._durable[path] = inode

    def open(self, path: Path, flags: int) -> int:
        fd = next(self._next)
        if flags & os.O_DIRECTORY:
            self._open[fd] = path
            return fd
        if not flags & os.O_CREAT:
            self._open[fd] = self._names[path]
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

    def truncate(self, fd: int, size: int) -> None:
        inode = self._open[fd]
        assert isinstance(inode, int)
        self._before.setdefault(inode, []).append(bytes(self._files[inode]))
        del self._files[inode][size:]
        self._snap()

    def fsync(self, fd: int) -> None:
        thing = self._open[fd]
        if isinstance(thing, int):
            self._synced[thing] = bytes(self._files[thing])
            self._before.pop(thing, None)
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
        for retained in range(len(self._pending) + 1):
            names = dict(self._durable)
            for change in self._pending[:retained]:
                self._apply(names, change)
            choices = []
            for path, inode in names.items():
                full, sure = bytes(self._files[inode]), self._synced[inode]
                lost = max(0, len(full) - len(sure))
                contents = {
                    *self._before.get(inode, ()),
                    full,
                    sure,
                    sure + full[len(sure) : len(sure) + lost // 2],
                    sure + bytes(lost),
                }
                choices.append([(path, content) for content in sorted(contents)])
            for state in itertools.product(*choices):
                yield dict(state)
