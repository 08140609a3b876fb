"""Pool of estimator processes, started with the server to be warm before the first trial; restarted on
failure.

Runs on the event loop. Messages do not accumulate: of a log's sizes only the latest is sent.
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
"""With a larger backlog, a process receives no further sizes."""
LOOK_S: Final = 1.0
MODULE: Final = "sagittal.server.live.estimator"
"""Module of an estimator process."""


class EstimatorPool:
    """Estimator processes and their trials.

    Parameters
    ----------
    report : called with each message of a process. begin : creates the order to process a trial from its
        start, None if it has ended. restarted : called with the trials of a crashed process.
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
        """Process ids of the running processes."""
        return [pid for w in self._workers if (pid := w.process.pid) is not None]

    @property
    def is_ready(self) -> bool:
        """Whether all processes are warm."""
        return bool(self._workers) and all(w.process.is_warm for w in self._workers)

    def start(self) -> None:
        """Start the processes without waiting until they are warm; idempotent."""
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
        """Assign a trial to the least busy process, or restart it from the beginning in its process."""
        if not self._workers:
            return
        worker = self._of(take) or min(self._workers, key=lambda w: len(w.takes))
        worker.takes.add(take)
        order = self._begin(take)
        if order is not None:
            worker.send(order)

    def grow(self, take: str, size: int) -> None:
        """Register a log size of `size` bytes."""
        worker = self._of(take)
        if worker is not None:
            worker.grow(take, size)

    def send(self, order: Command | Charge) -> None:
        """Forward a command or battery levels."""
        worker = self._of(order.take)
        if worker is not None:
            worker.send(order)

    def leave(self, take: str) -> None:
        """Stop processing a trial."""
        worker = self._of(take)
        if worker is not None:
            worker.takes.discard(take)
            worker.send(ForgetTake(take))

    def follows(self, take: str) -> bool:
        """Whether a process is assigned to this trial."""
        return self._of(take) is not None

    def _of(self, take: str) -> _Estimator | None:
        return next((w for w in self._workers if take in w.takes), None)

    async def _look(self) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            for worker in self._workers:
                worker.look()

    # messages of a worker

    def handle_message(self, report: Report) -> None:
        """Callback of a worker for each report."""
        self._report(report)

    def list_orders(self, takes: set[str]) -> list[Order]:
        """Callback of a starting worker: orders for its trials."""
        orders = {take: self._begin(take) for take in takes}
        takes.difference_update(take for take, order in orders.items() if order is None)
        return [order for order in orders.values() if order is not None]

    def note_death(self, takes: set[str]) -> None:
        """Callback of a worker whose process ended unexpectedly."""
        self._restarted(sorted(takes))

    @property
    def settings(self) -> Settings:
        """Settings of the installation."""
        return self._settings


class _Estimator:
    """One worker and its trials; its process may be replaced."""

    def __init__(self, pool: EstimatorPool) -> None:
        self._pool = pool
        self.takes: set[str] = set()
        self.process = KeptProcess(MODULE, pool.settings, self._greet, self._hear, self._mourn)
        self._sizes: dict[str, int] = {}
        self._at = 0.0
        self._flushing = False

    def send(self, order: Order) -> None:
        # messages sent before a process exists are included in its Begin
        if not self.process.is_connected:
            return
        self._flush()
        self.process.send(encode(order))

    def grow(self, take: str, size: int) -> None:
        self._sizes[take] = size
        self._at = time.monotonic()
        if not self._flushing:
            # once per turn of the loop, for all trials with new data
            self._flushing = True
            asyncio.get_running_loop().call_soon(self._flush)

    def look(self) -> None:
        """End a hung process; flush pending messages."""
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
