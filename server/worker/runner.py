"""Control of the child process by the worker: start, send orders, receive, kill."""

from __future__ import annotations

from sagittal.server.processes.channel import Channel
from sagittal.server.processes.child import BEHIND, end_process, start_child
from sagittal.server.settings import Settings
from sagittal.server.worker.messages import Order, Reply, decode_reply, encode


class ChildDiedError(Exception):
    """The child ended without a response."""


class Child:
    """A running child process; it is warm after its first ChildReady."""

    def __init__(self, settings: Settings) -> None:
        self._process, line = start_child("sagittal.server.worker.child", settings, BEHIND)
        self._line = Channel(line)

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def send(self, order: Order) -> None:
        """Send an order; raises ChildDiedError."""
        try:
            self._line.send(encode(order))
        except OSError:
            raise self._death() from None

    def receive(self, timeout_s: float) -> Reply | None:
        """Return the next message, None on timeout; raises ChildDiedError."""
        try:
            return decode_reply(self._line.receive()) if self._line.has_message(timeout_s) else None
        except (EOFError, OSError):
            raise self._death() from None

    def kill(self) -> None:
        """Kill the child and wait for it."""
        end_process(self._process)
        self._line.close()

    def _death(self) -> ChildDiedError:
        self.kill()
        return ChildDiedError(f"computing process {self.pid} ended with status {self._process.returncode}")
