"""An operating system whose n-th call fails: SQLite's way of testing, applied to our own files."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from sagittal.server.storage import fs


class FailingSystem(fs.System):
    """The operating system, but its n-th call fails."""

    def __init__(self, fail_at: int, number: int) -> None:
        self.calls = 0
        self._fail_at, self._number = fail_at, number

    def _count(self) -> None:
        self.calls += 1
        if self.calls == self._fail_at:
            raise OSError(self._number, os.strerror(self._number))

    def open(self, path: Path, flags: int) -> int:
        self._count()
        return super().open(path, flags)

    def write(self, fd: int, data: bytes | memoryview) -> int:
        self._count()
        return super().write(fd, data)

    def fsync(self, fd: int) -> None:
        self._count()
        super().fsync(fd)

    def truncate(self, fd: int, size: int) -> None:
        self._count()
        super().truncate(fd, size)

    def replace(self, source: Path, target: Path) -> None:
        self._count()
        super().replace(source, target)

    def mkdir(self, path: Path) -> None:
        self._count()
        super().mkdir(path)


class PowerError(Exception):
    """The power is gone."""


class Dying(FailingSystem):
    """The power goes before the n-th call that changes something, and stays away."""

    def __init__(self, after: int) -> None:
        super().__init__(after, errno.EIO)

    def _count(self) -> None:
        self.calls += 1
        if self.calls > self._fail_at:
            raise PowerError

    def unlink(self, path: Path) -> None:
        self._count()
        super().unlink(path)
