"""A process of ours that is started for one answer and ends with it: what it computes stops nobody else."""

from __future__ import annotations

from server.processes.channel import Channel
from server.processes.child import end_process, start_child
from server.settings import Settings


def run_errand(module: str, settings: Settings, order: bytes, longest_s: float) -> bytes:
    """Start a module that begins with `enter_child`, give it an order and return what it answers.

    Raises
    ------
    TimeoutError
        there was no answer within `longest_s`. EOFError, OSError: the process ended without one.
    """
    process, end = start_child(module, settings)
    line = Channel(end)
    try:
        line.send(order)
        if not line.has_message(longest_s):
            raise TimeoutError
        return line.receive()
    finally:
        line.close()
        end_process(process)
