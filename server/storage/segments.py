"""Log of a live trial: `live/<take>.log`, appended during streaming and read after a crash.

A log is created durably with its header and first record, so an existing file is always a valid log; then
records are appended and synced in groups. After a crash the longest valid prefix remains (for the format see
core/formats/live_log.py); reading never needs more than a few megabytes of memory.
"""

from __future__ import annotations

import logging
import mmap
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, Final

from sagittal.core.errors import InputError
from sagittal.core.formats.live_log import (
    FILE_MARK,
    MOST_FRAME_BYTES,
    RECORD_HEAD,
    RECORD_STARTS,
    LogRecord,
    is_whole_length,
    record,
    scan_records,
)
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.server.storage import fs

log = logging.getLogger(__name__)

CHUNK: Final = 1 << 22
"""Bytes read at once."""
_LONGEST: Final = MOST_FRAME_BYTES + 64
"""No record is longer."""


@dataclass(frozen=True)
class Damage:
    """Unreadable part of a log although it was written: `lost` bytes from `start` on, and the retained
    copy.
    """

    start: int
    lost: int
    original: Path | None = None

    @property
    def sentence(self) -> str:
        """Description for users."""
        return (
            f"{self.lost} {plural(self.lost, 'byte', 'bytes')} of the live recording "
            f"{plural(self.lost, 'was', 'were')} damaged on the server's disk and "
            f"{plural(self.lost, 'is', 'are')} left out. The original is kept; ask your administrator."
        )


class TakeLog:
    """A log open for appending.

    Parameters
    ----------
    path : the file. size : its bytes, all complete and synced records. damage : part that was removed.
    """

    def __init__(self, path: Path, size: int, damage: Damage | None = None) -> None:
        self.path = path
        self.damage = damage
        self._file = fs.AppendOnlyFile(path, size)
        self._synced = size

    @property
    def size(self) -> int:
        """Readable bytes, all complete records."""
        return self._file.size

    def append(self, records: bytes) -> None:
        """Append complete records; after an OSError (disk full) none is stored and a retry may work."""
        self._file.append(records)

    def sync(self) -> None:
        """Wait until everything appended is durable; after an OSError call `drop_unsynced`."""
        self._file.sync()
        self._synced = self._file.size

    def drop_unsynced(self) -> None:
        """Durably truncate to the synced part."""
        self._file.cut(self._synced)
        self._file.sync()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def create(path: Path, hello: bytes) -> TakeLog:
    """Create a log with a durable header and hello.

    Parameters
    ----------
    hello : JSON, without the token.

    Raises
    ------
    InputError
        `live_log_damaged`: a file exists that contains more than part of this header.
    """
    content = FILE_MARK + record("H", hello)
    fs.make_folder(path.parent)
    if path.exists() and not content.startswith(_head(path, len(content))):
        raise InputError(
            "live_log_damaged",
            Message(
                "{name} is there but is not a live log; it was left as it is. Begin a new take.",
                name=path.name,
            ),
        )
    fs.write_file(path, content)
    return TakeLog(path, len(content))


def recover(path: Path, see: Callable[[LogRecord], None]) -> TakeLog | None:
    """Open a log whose writer has ended, durably truncated to its longest valid prefix.

    A full copy of a damaged log is retained, and `TakeLog.damage` describes it.

    Parameters
    ----------
    see : called with every valid record, in order.

    Returns
    -------
    None, without changes, if there is no complete first record, which cannot result from a crash of ours.
    """
    size = 0
    for size, one in read_records(path):  # noqa: B007 - the last one is used
        see(one)
    if not size:
        return None
    damage = find_damage(path, size)
    if damage is not None:
        damage = replace(damage, original=keep_original(path))
        log.warning("%s: %s Kept as %s.", path.name, damage.sentence, damage.original)
    opened = TakeLog(path, size, damage)
    # even if nothing is truncated: data of a killed process may be in memory only, and will now be
    # acknowledged as durable
    try:
        opened.drop_unsynced()
        fs.sync_folder(path.parent)
    except OSError:
        opened.close()
        raise
    return opened


def find_damage(path: Path, size: int) -> Damage | None:
    """Damage after the first `size` bytes of a log, other than an end torn by a crash.

    A log is damaged if a complete record follows unreadable data, or if the last record has its full length
    but invalid content. A torn end is shorter, or ends in zeros of blocks never written.
    """
    length = path.stat().st_size
    if length <= size:
        return None
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if is_whole_length(data[size : size + RECORD_HEAD], length - size) and data[length - 1]:
            return Damage(size, length - size)
        for mark in RECORD_STARTS:
            position = data.find(mark, size)
            while position >= 0:
                begin = position - RECORD_HEAD
                if begin > size and scan_records(data[begin : begin + _LONGEST])[0]:
                    return Damage(size, length - size)
                position = data.find(mark, position + 1)
    return None


def count_readable_bytes(path: Path) -> int:
    """Number of bytes in complete records from the start of a log; 0 = not even the first."""
    size = 0
    for size, _ in read_records(path):  # noqa: B007 - the last one is used
        pass
    return size


def keep_original(path: Path) -> Path:
    """Durably copy a log to an unused name in the same folder, and return that."""
    number = 1
    while (target := path.with_name(f"{path.stem}.{number}.damaged")).exists():
        number += 1
    with fs.IncomingFile(path.parent) as copy, path.open("rb") as file:
        while chunk := file.read(CHUNK):
            copy.write(chunk)
        copy.keep(target)
    return target


def _head(path: Path, size: int) -> bytes:
    with path.open("rb") as file:
        return file.read(size + 1)


def read_records(path: Path, start: int = 0) -> Iterator[tuple[int, LogRecord]]:
    """Yield the complete records of a log with their end offsets, reading a few megabytes at a time.

    Parameters
    ----------
    start : 0, or the end of an earlier record. Do not use `LogRecord.end`, which is relative to a chunk.
    """
    with path.open("rb") as file:
        yield from read_open_records(file, start)


def read_open_records(file: BinaryIO, start: int = 0) -> Iterator[tuple[int, LogRecord]]:
    """Like `read_records` for an open file, positioned at its start."""
    if start == 0:
        start = len(FILE_MARK)
        if file.read(start) != FILE_MARK:
            return
    file.seek(start)
    unread = b""
    while chunk := file.read(CHUNK):
        unread += chunk
        records, used = scan_records(unread)
        for one in records:
            yield start + one.end, one
        start, unread = start + used, unread[used:]
        if len(unread) >= _LONGEST:
            return  # a complete record would have fitted: it is damaged
