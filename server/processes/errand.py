"""One-shot child processes that compute a single result without blocking the server."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Final

from sagittal.server.processes.channel import Channel
from sagittal.server.processes.child import end_process, start_child
from sagittal.server.settings import Settings

MOST_WAITING: Final = 3
"""Queue length for errands of a kind: each occupies one of the few threads that serve requests."""


class TooManyErrands(Exception):  # noqa: N818 - says what is refused
    """The waiting queue is full."""


class ErrandTurn:
    """Runs one errand of a kind at a time; a few wait, further ones are rejected immediately."""

    def __init__(self) -> None:
        self._turn = threading.Semaphore(1)
        self._places = threading.Semaphore(1 + MOST_WAITING)

    @contextlib.contextmanager
    def take(self) -> Iterator[None]:
        """Wait for the turn and hold it; raises TooManyErrands."""
        if not self._places.acquire(blocking=False):
            raise TooManyErrands
        try:
            with self._turn:
                yield
        finally:
            self._places.release()


def run_errand(module: str, settings: Settings, order: bytes, longest_s: float, niceness: int = 0) -> bytes:
    """Start a module that begins with `enter_child`, send it a request and return the response.

    Parameters
    ----------
    niceness : increment of the nice value relative to this process.

    Raises
    ------
    TimeoutError
        no response within `longest_s`. EOFError, OSError: the process ended without one.
    """
    process, end = start_child(module, settings, niceness)
    line = Channel(end)
    try:
        line.send(order)
        if not line.has_message(longest_s):
            raise TimeoutError
        return line.receive()
    finally:
        line.close()
        end_process(process)
