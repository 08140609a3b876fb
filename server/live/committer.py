"""Thread that writes and syncs the logs of all live trials, so that disk access never blocks the event loop.

Records are written immediately, so that the estimator can read them, and synced in groups at most
`INTERVAL_S` after the first of them: a sync costs milliseconds whatever its size, an acknowledgement that
comes without one is worth nothing (measured: 109 acknowledged batches lost in 8 kills; with it none).
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any, Protocol

from sagittal.server.storage.disk_log import DiskLog
from sagittal.server.storage.segments import TakeLog

log = logging.getLogger(__name__)

INTERVAL_S = 0.2
"""Maximum delay before a written record is synced with its group; including the sync within 250 ms."""

SYNCERS = 4
"""Logs synced concurrently: they share the file system's commits (measured, 200 logs: one after the other 46
ms, four at a time 22 ms on an idle disk, 380 and 40 ms on a busy one).
"""

BREATH_S = 0.004
"""Minimum time between two rounds of writing: with many trials a round writes many records, which reduces
switching between the thread and the event loop (measured with 200 tablets: a third of the CPU).
"""

Post = Callable[[Callable[[Any], None], Any], None]
"""Posts a call to the event loop; tests call directly."""


class LoopMailbox:
    """Thread-safe queue of calls on an event loop, which processes many per wake-up."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop
        self._calls: deque[tuple[Callable[[Any], None], Any]] = deque()
        self._under_way = False

    def post(self, callback: Callable[[Any], None], value: object) -> None:
        """Call `what(value)` on the loop, after everything posted earlier."""
        self._calls.append((callback, value))
        if not self._under_way:
            self._under_way = True
            with contextlib.suppress(RuntimeError):  # the loop has ended, so there is no recipient
                self.loop.call_soon_threadsafe(self._deliver)

    def _deliver(self) -> None:
        # before taking the first: later calls are taken as well, or wake the loop again
        self._under_way = False
        while self._calls:
            callback, value = self._calls.popleft()
            callback(value)


class LaneOwner(Protocol):
    """Callbacks for events of a lane, posted to the event loop in order."""

    def note_written(self, size: int) -> None:
        """The log has `size` readable bytes."""

    def note_synced(self, records: int) -> None:
        """The first `records` records put into the lane are durable."""

    def note_failure(self, error: OSError) -> None:
        """A disk error occurred; nothing more is written until the lane is mended."""


class LogLane:
    """One log and its queue of records.

    The event loop only adds records; all other methods access the disk and must run in a thread.

    Parameters
    ----------
    log : owned by the lane. owner : receives callbacks. disk : shared reporter of failures.
    """

    def __init__(self, log: TakeLog, owner: LaneOwner, post: Post, disk: DiskLog) -> None:
        self.log, self._disk = log, disk
        self._owner, self._post = owner, post
        self._queue: deque[bytes] = deque()
        self._lock = threading.Lock()
        self._broken = False
        self._written = 0
        self._synced = 0

    def put(self, record: bytes) -> None:
        """Queue one record; never blocks."""
        self._queue.append(record)

    def write(self) -> bool:
        """Write queued records; return whether a sync is required."""
        with self._lock:
            records = [self._queue.popleft() for _ in range(len(self._queue))]
            if records and not self._broken:
                try:
                    self.log.append(b"".join(records))
                except Exception as error:  # noqa: BLE001 - logged, whatever it is
                    self._disk.note_refusal(error, f"the live log {self.log.path.name}")
                    self._break(error)
                else:
                    self._written += len(records)
                    self._post(self._owner.note_written, self.log.size)
            return self._written > self._synced and not self._broken

    def sync(self) -> None:
        """Sync written records."""
        with self._lock:
            if self._broken or self._written == self._synced:
                return
            try:
                self.log.sync()
            except Exception as error:  # noqa: BLE001 - logged, whatever it is
                self._disk.note_refusal(error, f"the live log {self.log.path.name}")
                self._break(error)
            else:
                self._synced = self._written
                self._disk.note_success()
                self._post(self._owner.note_synced, self._synced)

    def mend(self) -> None:
        """Truncate to the synced part and restart the count of records; OSError if the disk still fails.

        After a failed sync it is unknown which pages reached the disk, and a second sync would not report it
        (the kernel has marked them clean), so unsynced records are dropped and must be sent again.
        """
        with self._lock:
            self._queue.clear()
            self.log.drop_unsynced()
            self._written = self._synced = 0
            self._broken = False

    def close(self) -> None:
        """Write and sync queued records, then close the log."""
        self.write()
        self.sync()
        with self._lock:
            self._broken = True
            self.log.close()

    def _break(self, error: Exception) -> None:
        """Stop this trial's log on any error (out of memory, a bug); other lanes continue."""
        self._broken = True
        self._post(
            self._owner.note_failure, error if isinstance(error, OSError) else OSError(errno.EIO, str(error))
        )


class Committer:
    """Thread that writes the lanes that wake it.

    Parameters
    ----------
    interval_s : maximum delay before a written record is synced with its group.
    """

    def __init__(self, interval_s: float = INTERVAL_S) -> None:
        self._interval_s = interval_s
        self.disk = DiskLog(log)
        self._woken: deque[LogLane] = deque()
        self._dirty: dict[LogLane, None] = {}
        self._work = threading.Event()
        self._stopping = False
        self._thread: threading.Thread | None = None
        self._letters: LoopMailbox | None = None
        self._syncers = ThreadPoolExecutor(SYNCERS, "live-sync")

    def start(self) -> None:
        """Start the thread."""
        self._thread = threading.Thread(target=self._run, name="live-log", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Write and sync all queued records, then end the thread."""
        self._stopping = True
        self._work.set()
        if self._thread is not None:
            self._thread.join()
        self._syncers.shutdown()

    def post_to(self, loop: asyncio.AbstractEventLoop) -> Post:
        """Mailbox of an event loop, shared by all its lanes."""
        if self._letters is None or self._letters.loop is not loop:
            self._letters = LoopMailbox(loop)
        return self._letters.post

    def wake(self, lane: LogLane) -> None:
        """Schedule a lane for writing; never blocks."""
        self._woken.append(lane)
        self._work.set()

    def write(self) -> None:
        """Write the queued records of all scheduled lanes."""
        for _ in range(len(self._woken)):
            lane = self._woken.popleft()
            if lane.write():
                self._dirty[lane] = None

    def sync(self) -> None:
        """Sync all lanes, writing new records in the meantime."""
        lanes, self._dirty = self._dirty, {}
        if len(lanes) == 1:
            next(iter(lanes)).sync()
            return
        syncing = {self._syncers.submit(lane.sync) for lane in lanes}
        while syncing:
            done, syncing = wait(syncing, timeout=BREATH_S)
            for one in done:
                one.result()
            self.write()

    def _run(self) -> None:
        due: float | None = None
        breathed = 0.0
        while not self._stopping:
            self._work.wait(None if due is None else max(0.0, due - time.monotonic()))
            time.sleep(max(0.0, breathed + BREATH_S - time.monotonic()))
            self._work.clear()
            self.write()
            breathed = time.monotonic()
            if due is not None and time.monotonic() >= due:
                self.sync()
                due = None
            if due is None and self._dirty:
                due = time.monotonic() + self._interval_s
        self.write()
        self.sync()
