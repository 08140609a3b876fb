"""Permanent child process on the event loop, restarted when it dies or hangs."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import subprocess
import time
from collections.abc import Callable, Iterable
from typing import Final

from sagittal.server.processes.channel import frame, read_message
from sagittal.server.processes.child import end_process, start_child
from sagittal.server.settings import Settings

log = logging.getLogger(__name__)

RESTART_S: Final = (0.0, 0.5, 2.0, 5.0, 15.0)
"""Pause before a restart, by the number of consecutive crashes."""
CALM_S: Final = 60.0
"""Run time after which earlier crashes are forgotten."""
HUNG_S: Final = 20.0
"""A process that owes a response for this long is restarted."""
GRACE_S: Final = 1.0
"""Time limit for a process to end on its own."""


class KeptProcess:
    """Child process that is restarted when it ends.

    Parameters
    ----------
    module : module to run; begins with `enter_child`.
    greet : called when a process has started; returns the first messages for it.
    hear : called with every message of the process.
    mourn : called when a process has ended unexpectedly, before the next is started.

    Attributes
    ----------
    is_warm : set by the receiver of messages when the process is ready; reset when it ends.
    """

    is_warm = False

    def __init__(
        self,
        module: str,
        settings: Settings,
        greet: Callable[[], Iterable[bytes]],
        hear: Callable[[bytes], None],
        mourn: Callable[[], None],
    ) -> None:
        self._module, self._settings = module, settings
        self._greet, self._hear, self._mourn = greet, hear, mourn
        self._process: subprocess.Popen[bytes] | None = None
        self._writer: asyncio.StreamWriter | None = None
        self._heard = time.monotonic()
        self._owes: float | None = None
        self._deaths = 0
        self._task: asyncio.Task[None] | None = None

    @property
    def pid(self) -> int | None:
        """Process id, None while no process is running."""
        process = self._process
        return process.pid if process is not None and process.poll() is None else None

    @property
    def is_connected(self) -> bool:
        """Whether there is a process to send to."""
        return self._writer is not None

    @property
    def backlog_bytes(self) -> int:
        """Number of bytes not yet read by the process."""
        return 0 if self._writer is None else self._writer.transport.get_write_buffer_size()

    def start(self) -> None:
        """Start the process; returns at once."""
        self._task = asyncio.create_task(self._keep())

    async def stop(self) -> None:
        """End the process without restarting it."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    def send(self, message: bytes) -> None:
        """Queue a message; it is dropped if there is no process."""
        if self._writer is not None and not self._writer.is_closing():
            self._writer.write(frame(message))

    def expect_answer(self) -> None:
        """Expect a message from the process within HUNG_S; any message satisfies it."""
        self._owes = self._owes or time.monotonic()

    def end_if_hung(self) -> None:
        """Kill a warm process whose expected message is overdue by HUNG_S; it is then restarted."""
        hung = (
            self.is_warm
            and self._owes is not None
            and time.monotonic() - max(self._owes, self._heard) > HUNG_S
        )
        if hung and self._process is not None:
            pid = self._process.pid
            log.warning("%s: process %d says nothing any more; it is replaced", self._module, pid)
            self._process.kill()

    async def _keep(self) -> None:
        """Restart the process until cancelled."""
        while True:
            began = time.monotonic()
            try:
                await self._live()
            finally:
                await self._end()
            log.warning("%s: a process has ended; starting another", self._module)
            self._mourn()
            self._deaths = 1 if time.monotonic() - began > CALM_S else self._deaths + 1
            await asyncio.sleep(RESTART_S[min(self._deaths, len(RESTART_S)) - 1])

    async def _live(self) -> None:
        """Start a process, send the first messages and receive until it ends."""
        self._process, line = start_child(self._module, self._settings)
        reader, self._writer = await asyncio.open_connection(sock=line)
        self._heard, self._owes = time.monotonic(), None
        for message in self._greet():
            self.send(message)
        with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                message = await read_message(reader)
                self._heard, self._owes = time.monotonic(), None
                self._hear(message)

    async def _end(self) -> None:
        """Release all resources of the process, in any state."""
        self.is_warm = False
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()
        process, self._process = self._process, None
        if process is None:
            return
        if process.stdin is not None:
            process.stdin.close()
        limit = time.monotonic() + GRACE_S
        while process.poll() is None and time.monotonic() < limit:
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.sleep(0.01)
        end_process(process)
