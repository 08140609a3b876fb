"""The log of a live take: `live/<take>.log`, appended to while it streams, read back after a crash.

A log begins durably with its header and its first record, so whoever finds the file finds a whole log; after
that records are appended and synced in groups. What a crash leaves is the longest valid prefix
(core/formats/live_log.py has the bytes); reading never holds more than a few megabytes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from core.errors import InputError
from core.formats.live_log import FILE_MARK, MOST_FRAME_BYTES, Record, record, scan_records
from server.storage import fs

CHUNK: Final = 1 << 22
"""Bytes read at once."""
_LONGEST: Final = MOST_FRAME_BYTES + 64
"""No record is longer."""


class TakeLog:
    """A log that is open for appending.

    Parameters
    ----------
    path : the file. size : its bytes, all of them whole records and synced.
    """

    def __init__(self, path: Path, size: int) -> None:
        self.path = path
        self._file = fs.Growing(path, size)
        self._synced = size

    @property
    def size(self) -> int:
        """Bytes that can be read now, whole records all of them."""
        return self._file.size

    def append(self, records: bytes) -> None:
        """Write whole records; after an OSError (disk full) none of them is there and a retry may work."""
        self._file.append(records)

    def sync(self) -> None:
        """Wait until everything appended survives a power cut; after an OSError go `back`."""
        self._file.sync()
        self._synced = self._file.size

    def back(self) -> None:
        """Cut off what has not been synced, durably."""
        self._file.cut(self._synced)
        self._file.sync()

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


def create(path: Path, hello: bytes) -> TakeLog:
    """Begin a log; when this returns mark and hello survive a power cut.

    Parameters
    ----------
    hello : JSON, without the token.

    Raises
    ------
    InputError
        `live_log_damaged`: a file is there already that is more than a part of this beginning.
    """
    content = FILE_MARK + record("H", hello)
    fs.make_folder(path.parent)
    if path.exists() and not content.startswith(_head(path, len(content))):
        raise InputError(
            "live_log_damaged",
            f"{path.name} is there but is not a live log; it was left as it is. Begin a new take.",
        )
    fs.write_file(path, content)
    return TakeLog(path, len(content))


def recover(path: Path, see: Callable[[Record], None]) -> TakeLog | None:
    """Open a log whose writer has ended: its longest valid prefix stays, durably; the rest is cut off.

    Parameters
    ----------
    see : gets every record that stays, in order.

    Returns
    -------
    None, and nothing is touched, when there is no whole first record. A crash of ours does not leave that.
    """
    size = 0
    for size, one in records(path):  # noqa: B007 - the last one is used
        see(one)
    if not size:
        return None
    log = TakeLog(path, size)
    # also when nothing is cut: what a killed process wrote may still be in memory only, and the sender is
    # about to be told that it is kept
    try:
        log.back()
        fs.sync_folder(path.parent)
    except OSError:
        log.close()
        raise
    return log


def _head(path: Path, size: int) -> bytes:
    with path.open("rb") as file:
        return file.read(size + 1)


def records(path: Path, start: int = 0) -> Iterator[tuple[int, Record]]:
    """Read the whole records of a log and where in the file each ends, a few megabytes at a time.

    Parameters
    ----------
    start : 0, or the end of a record read before. `Record.end` is of no use here: it counts in a chunk.
    """
    with path.open("rb") as file:
        if start == 0:
            start = len(FILE_MARK)
            if file.read(start) != FILE_MARK:
                return
        file.seek(start)
        rest = b""
        while chunk := file.read(CHUNK):
            rest += chunk
            found, used = scan_records(rest)
            for one in found:
                yield start + one.end, one
            start, rest = start + used, rest[used:]
            if len(rest) >= _LONGEST:
                return  # a whole record would have fitted: it is damaged
