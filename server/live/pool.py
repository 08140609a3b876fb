"""The estimator processes: started with the server to be warm before the first take; replaced when they die.

Used on the event loop. What goes to a process never piles up: of a log's lengths only the newest counts.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Final

from sagittal.server.live.messages import (
    Charge,
    Command,
    EstimatorReady,
    FollowTake,
    ForgetTake,
    LogGrown,
    Order,
    Report,
    decode_report,
    encode,
)
from sagittal.server.processes.kept_process import KeptProcess
from sagittal.server.settings import Settings

BACKLOG_BYTES: Final = 1 << 16
"""While so much waits for a process to read it, it is told no further lengths."""
LOOK_S: Final = 1.0
MODULE: Final = "sagittal.server.live.estimator"
"""What an estimator process runs."""


class EstimatorPool:
    """Estimator processes and which take each of them follows.

    Parameters
    ----------
    report : called with everything a process says. begin : makes the order to follow a take from its start,
        None when it is over. restarted : called with the takes of a process that has died.
    """

    def __init__(
        self,
        settings: Settings,
        report: Callable[[Report], None],
        begin: Callable[[str], FollowTake | None],
        restarted: Callable[[list[str]], None],
    ) -> None:
        self._settings = settings
        self._report = report
        self._begin = begin
        self._restarted = restarted
        self._workers: list[_Estimator] = []
        self._watch: asyncio.Task[None] | None = None

    @property
    def pids(self) -> list[int]:
        """Process ids of those that live."""
        return [pid for w in self._workers if (pid := w.process.pid) is not None]

    @property
    def is_ready(self) -> bool:
        """Whether every process has said that it is warm."""
        return bool(self._workers) and all(w.process.is_warm for w in self._workers)

    def start(self) -> None:
        """Start the processes, once; they get warm by themselves."""
        if self._workers or not self._settings.live_workers:
            return
        self._workers = [_Estimator(self) for _ in range(self._settings.live_workers)]
        for worker in self._workers:
            worker.process.start()
        self._watch = asyncio.create_task(self._look())

    async def stop(self) -> None:
        """End all processes."""
        if self._watch is not None:
            self._watch.cancel()
            await asyncio.gather(self._watch, return_exceptions=True)
        await asyncio.gather(*(w.process.stop() for w in self._workers))
        self._workers = []

    def follow(self, take: str) -> None:
        """Give a take to the process with the fewest, or have its process read it again from the start."""
        if not self._workers:
            return
        worker = self._of(take) or min(self._workers, key=lambda w: len(w.takes))
        worker.takes.add(take)
        order = self._begin(take)
        if order is not None:
            worker.send(order)

    def grow(self, take: str, size: int) -> None:
        """A take's log has `size` bytes."""
        worker = self._of(take)
        if worker is not None:
            worker.grow(take, size)

    def send(self, order: Command | Charge) -> None:
        """Hand on a command or the battery."""
        worker = self._of(order.take)
        if worker is not None:
            worker.send(order)

    def leave(self, take: str) -> None:
        """Follow a take no longer."""
        worker = self._of(take)
        if worker is not None:
            worker.takes.discard(take)
            worker.send(ForgetTake(take))

    def follows(self, take: str) -> bool:
        """Whether a process follows this take."""
        return self._of(take) is not None

    def _of(self, take: str) -> _Estimator | None:
        return next((w for w in self._workers if take in w.takes), None)

    async def _look(self) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            for worker in self._workers:
                worker.look()

    # what a worker tells

    def handle_message(self, report: Report) -> None:
        """Called by a worker with every report."""
        self._report(report)

    def list_orders(self, takes: set[str]) -> list[Order]:
        """Called by a worker that starts: what it is to follow."""
        orders = {take: self._begin(take) for take in takes}
        takes.difference_update(take for take, order in orders.items() if order is None)
        return [order for order in orders.values() if order is not None]

    def note_death(self, takes: set[str]) -> None:
        """Called by a worker whose process has ended unasked."""
        self._restarted(sorted(takes))

    @property
    def settings(self) -> Settings:
        """Of the installation."""
        return self._settings


class _Estimator:
    """One process and the takes it follows; the process may be another each time."""

    def __init__(self, pool: EstimatorPool) -> None:
        self._pool = pool
        self.takes: set[str] = set()
        self.process = KeptProcess(MODULE, pool.settings, self._greet, self._hear, self._mourn)
        self._sizes: dict[str, int] = {}
        self._at = 0.0
        self._flushing = False

    def send(self, order: Order) -> None:
        # what is sent before a process is there is in the Begin it will get
        if not self.process.is_connected:
            return
        self._flush()
        self.process.send(encode(order))

    def grow(self, take: str, size: int) -> None:
        self._sizes[take] = size
        self._at = time.monotonic()
        if not self._flushing:
            # once per turn of the loop, for all takes that grew in it
            self._flushing = True
            asyncio.get_running_loop().call_soon(self._flush)

    def look(self) -> None:
        """End a process that hangs; flush what waited for it to read."""
        if self._sizes:
            self._flush()
        self.process.end_if_hung()

    def _flush(self) -> None:
        self._flushing = False
        if not self.process.is_connected or not self._sizes:
            return
        if self.process.backlog_bytes > BACKLOG_BYTES:
            return
        sizes, self._sizes = self._sizes, {}
        self.process.expect_answer()
        self.process.send(encode(LogGrown(sizes, self._at)))

    def _greet(self) -> list[bytes]:
        self._sizes.clear()
        return [encode(order) for order in self._pool.list_orders(self.takes)]

    def _hear(self, message: bytes) -> None:
        report = decode_report(message)
        if isinstance(report, EstimatorReady):
            self.process.is_warm = True
        self._pool.handle_message(report)

    def _mourn(self) -> None:
        self._pool.note_death(self.takes)
