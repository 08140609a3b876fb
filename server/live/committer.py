"""One thread that writes and syncs the logs of all takes, so that no disk ever holds up the event loop.

Records are written as soon as they come, so that the estimator can read them, and synced in groups at most
`INTERVAL_S` after the first of them: a sync costs milliseconds whatever its size, an acknowledgement that
comes without one is worth nothing (measured: 109 acknowledged batches lost in 8 kills; with it none).
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

from server.storage.segments import TakeLog

log = logging.getLogger(__name__)

INTERVAL_S = 0.2
"""Longest time a written record waits for its group to be synced; with the sync itself within 250 ms."""

Post = Callable[..., object]
"""`loop.call_soon_threadsafe`: how the thread tells the event loop; tests call directly."""


class Owner(Protocol):
    """Who is told about a lane; all calls are posted to the event loop, in the order they happened."""

    def written(self, size: int) -> None:
        """The log has `size` bytes that can be read."""

    def synced(self, records: int) -> None:
        """The first `records` records put into the lane survive a power cut."""

    def broke(self, error: OSError) -> None:
        """The disk refused; nothing more is written until the lane is mended."""


class Lane:
    """One log and the records on their way to it.

    The event loop only puts records in; everything else touches the disk and belongs into a thread.

    Parameters
    ----------
    log : owned by the lane from now on. owner : told what happens. post : `loop.call_soon_threadsafe`.
    """

    def __init__(self, log: TakeLog, owner: Owner, post: Post) -> None:
        self.log = log
        self._owner, self._post = owner, post
        self._queue: deque[bytes] = deque()
        self._lock = threading.Lock()
        self._broken = False
        self._written = 0
        self._synced = 0

    def put(self, record: bytes) -> None:
        """Queue one record; never waits."""
        self._queue.append(record)

    def write(self) -> bool:
        """Write what is queued; whether anything waits for a sync now."""
        with self._lock:
            records = [self._queue.popleft() for _ in range(len(self._queue))]
            if records and not self._broken:
                try:
                    self.log.append(b"".join(records))
                except OSError as error:
                    self._break(error)
                else:
                    self._written += len(records)
                    self._tell(self._owner.written, self.log.size)
            return self._written > self._synced and not self._broken

    def sync(self) -> None:
        """Sync what is written."""
        with self._lock:
            if self._broken or self._written == self._synced:
                return
            try:
                self.log.sync()
            except OSError as error:
                self._break(error)
            else:
                self._synced = self._written
                self._tell(self._owner.synced, self._synced)

    def mend(self) -> None:
        """Go back to what was synced and count records anew; OSError when the disk still refuses.

        After a failed sync nobody knows which pages reached the disk, and a second sync would not say so
        (the kernel has marked them clean), so what was not synced is cut off and has to be sent again.
        """
        with self._lock:
            self._queue.clear()
            self.log.back()
            self._written = self._synced = 0
            self._broken = False

    def close(self) -> None:
        """Write and sync what is there, then let go of the log."""
        self.write()
        self.sync()
        with self._lock:
            self._broken = True
            self.log.close()

    def _tell(self, what: Callable[..., None], value: object) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended: nobody is left to be told
            self._post(what, value)

    def _break(self, error: OSError) -> None:
        log.error("%s: %s", self.log.path.name, error)
        self._broken = True
        self._tell(self._owner.broke, error)


class Committer:
    """The thread; lanes make themselves known by waking it.

    Parameters
    ----------
    interval_s : longest time a written record waits for its group to be synced.
    """

    def __init__(self, interval_s: float = INTERVAL_S) -> None:
        self._interval_s = interval_s
        self._woken: deque[Lane] = deque()
        self._dirty: dict[Lane, None] = {}
        self._work = threading.Event()
        self._stopping = False
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Start the thread."""
        self._thread = threading.Thread(target=self._run, name="live-log", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Write and sync what has been put in, then end the thread."""
        self._stopping = True
        self._work.set()
        if self._thread is not None:
            self._thread.join()

    def wake(self, lane: Lane) -> None:
        """Say that a lane has something to write; never waits."""
        self._woken.append(lane)
        self._work.set()

    def write(self) -> None:
        """Write what the woken lanes hold."""
        for _ in range(len(self._woken)):
            lane = self._woken.popleft()
            if lane.write():
                self._dirty[lane] = None

    def sync(self) -> None:
        """Sync all lanes, one after the other; what comes meanwhile is written between two syncs."""
        lanes, self._dirty = self._dirty, {}
        for lane in lanes:
            lane.sync()
            self.write()

    def _run(self) -> None:
        due: float | None = None
        while not self._stopping:
            self._work.wait(None if due is None else max(0.0, due - time.monotonic()))
            self._work.clear()
            self.write()
            if due is not None and time.monotonic() >= due:
                self.sync()
                due = None
            if due is None and self._dirty:
                due = time.monotonic() + self._interval_s
        self.write()
        self.sync()
