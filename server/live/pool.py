"""The estimator processes: started with the server to be warm before the first take; replaced when they die.

Used on the event loop. What goes to a process never piles up: of a log's lengths only the newest counts.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Final

from server.live.messages import (
    Begin,
    Charge,
    Command,
    End,
    Grow,
    Order,
    Ready,
    Report,
    decode_report,
    encode,
)
from server.processes.environment import make_environment
from server.settings import Settings

log = logging.getLogger(__name__)

RESTART_S: Final = (0.0, 0.5, 2.0, 5.0, 15.0)
"""Pause before a process is replaced, by how many died one after another."""
CALM_S: Final = 60.0
"""A process that has lived so long is not blamed for the deaths before it."""
HUNG_S: Final = 20.0
"""A process that has been told of new samples and says nothing for so long is replaced."""
GRACE_S: Final = 1.0
"""Time a process has to end by itself."""
BACKLOG_BYTES: Final = 1 << 16
"""While so much waits for a process to read it, it is told no further lengths."""
LOOK_S: Final = 1.0

_LENGTH: Final = struct.Struct("!i")
"""Framing of multiprocessing.connection: messages below 2 GiB have their length before them."""


class Pool:
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
        begin: Callable[[str], Begin | None],
        restarted: Callable[[list[str]], None],
    ) -> None:
        self._settings = settings
        self._report = report
        self._begin = begin
        self._restarted = restarted
        self._workers: list[_Worker] = []
        self._watch: asyncio.Task[None] | None = None

    @property
    def pids(self) -> list[int]:
        """Process ids of those that live."""
        return [w.process.pid for w in self._workers if w.process is not None and w.process.poll() is None]

    @property
    def is_ready(self) -> bool:
        """Whether every process has said that it is warm."""
        return bool(self._workers) and all(w.ready for w in self._workers)

    def start(self) -> None:
        """Start the processes, once; they get warm by themselves."""
        if self._workers or not self._settings.live_workers:
            return
        self._workers = [_Worker(self) for _ in range(self._settings.live_workers)]
        for worker in self._workers:
            worker.start()
        self._watch = asyncio.create_task(self._look())

    async def stop(self) -> None:
        """End all processes."""
        if self._watch is not None:
            self._watch.cancel()
            await asyncio.gather(self._watch, return_exceptions=True)
        await asyncio.gather(*(w.stop() for w in self._workers))
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
            worker.send(End(take))

    def follows(self, take: str) -> bool:
        """Whether a process follows this take."""
        return self._of(take) is not None

    def _of(self, take: str) -> _Worker | None:
        return next((w for w in self._workers if take in w.takes), None)

    async def _look(self) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            for worker in self._workers:
                worker.look()

    # what a worker tells

    def said(self, report: Report) -> None:
        """Called by a worker with every report."""
        self._report(report)

    def again(self, takes: set[str]) -> list[Order]:
        """Called by a worker that starts: what it is to follow."""
        orders = {take: self._begin(take) for take in takes}
        takes.difference_update(take for take, order in orders.items() if order is None)
        return [order for order in orders.values() if order is not None]

    def died(self, takes: set[str]) -> None:
        """Called by a worker whose process has ended unasked."""
        self._restarted(sorted(takes))

    @property
    def settings(self) -> Settings:
        """Of the installation."""
        return self._settings


class _Worker:
    """One process, one after another."""

    def __init__(self, pool: Pool) -> None:
        self._pool = pool
        self.takes: set[str] = set()
        self.process: subprocess.Popen[bytes] | None = None
        self.ready = False
        self._writer: asyncio.StreamWriter | None = None
        self._sizes: dict[str, int] = {}
        self._at = 0.0
        self._flushing = False
        self._heard = time.monotonic()
        self._owes: float | None = None
        self._deaths = 0
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        self._task = asyncio.create_task(self._live())

    async def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    def send(self, order: Order) -> None:
        # what is sent before a process is there is in the Begin it will get
        if self._writer is None:
            return
        self._flush()
        self._write(order)

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
        hung = self._owes is not None and time.monotonic() - max(self._owes, self._heard) > HUNG_S
        if self.ready and hung and self.process is not None:
            log.warning("live estimator %d says nothing any more; it is replaced", self.process.pid)
            self.process.kill()

    def _flush(self) -> None:
        self._flushing = False
        if self._writer is None or not self._sizes:
            return
        if self._writer.transport.get_write_buffer_size() > BACKLOG_BYTES:
            return
        sizes, self._sizes = self._sizes, {}
        self._owes = self._owes or time.monotonic()
        self._write(Grow(sizes, self._at))

    def _write(self, order: Order) -> None:
        if self._writer is not None and not self._writer.is_closing():
            data = encode(order)
            self._writer.write(_LENGTH.pack(len(data)) + data)

    async def _live(self) -> None:
        """Keep one process alive until cancelled."""
        while True:
            began = time.monotonic()
            try:
                await self._one()
            finally:
                await self._end()
            log.warning("a live estimator has ended; starting another")
            self._pool.died(self.takes)
            self._deaths = 1 if time.monotonic() - began > CALM_S else self._deaths + 1
            await asyncio.sleep(RESTART_S[min(self._deaths, len(RESTART_S)) - 1])

    async def _one(self) -> None:
        """Start a process, give it its takes, listen until it is gone."""
        ours, theirs = socket.socketpair()
        with theirs:
            self.process = subprocess.Popen(  # noqa: S603 - our own module; a fork takes milliseconds
                [sys.executable, "-m", "server.live.estimator", str(theirs.fileno()), str(os.getpid())],
                env=make_environment(self._pool.settings),
                stdin=subprocess.PIPE,
                pass_fds=[theirs.fileno()],
            )
        reader, self._writer = await asyncio.open_connection(sock=ours)
        self._heard, self._owes = time.monotonic(), None
        self._sizes.clear()
        for order in self._pool.again(self.takes):
            self._write(order)
        with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                (length,) = _LENGTH.unpack(await reader.readexactly(_LENGTH.size))
                report = decode_report(await reader.readexactly(length))
                self._heard, self._owes = time.monotonic(), None
                if isinstance(report, Ready):
                    self.ready = True
                self._pool.said(report)

    async def _end(self) -> None:
        """Let go of the process, whatever state it is in."""
        self.ready = False
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()
        process, self.process = self.process, None
        if process is None:
            return
        if process.stdin is not None:
            process.stdin.close()
        limit = time.monotonic() + GRACE_S
        while process.poll() is None and time.monotonic() < limit:
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.sleep(0.01)
        process.kill()
        process.wait()
