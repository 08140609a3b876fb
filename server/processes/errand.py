"""A process of ours that is started for one answer and ends with it: what it computes stops nobody else."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Final

from sagittal.server.processes.channel import Channel
from sagittal.server.processes.child import end_process, start_child
from sagittal.server.settings import Settings

MOST_WAITING: Final = 3
"""Errands of a kind that may wait for their turn: each holds one of the few threads that answer requests."""


class TooManyErrands(Exception):  # noqa: N818 - says what is refused
    """As many as may wait do so already."""


class ErrandTurn:
    """One errand of a kind at a time; a few wait for it, more are refused at once."""

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


def run_errand(module: str, settings: Settings, order: bytes, longest_s: float, behind: int = 0) -> bytes:
    """Start a module that begins with `enter_child`, give it an order and return what it answers.

    Parameters
    ----------
    behind : by how much the process is nicer than this one.

    Raises
    ------
    TimeoutError
        there was no answer within `longest_s`. EOFError, OSError: the process ended without one.
    """
    process, end = start_child(module, settings, behind)
    line = Channel(end)
    try:
        line.send(order)
        if not line.has_message(longest_s):
            raise TimeoutError
        return line.receive()
    finally:
        line.close()
        end_process(process)
