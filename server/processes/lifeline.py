"""No process outlives the one that started it.

The starter holds the other end of our standard input and never writes to it. When it is gone, whatever way,
we read the end of the file. On Linux the kernel also kills us, in the middle of a computation too.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable

PR_SET_PDEATHSIG = 1
"""prctl(2): the signal to get when the parent dies; linux/prctl.h."""


_actions: list[Callable[[], None]] = []


def call_when_parent_ends(action: Callable[[], None]) -> None:
    """Call `action` in a thread when the starter has gone; it replaces what was to be called before."""
    is_first = not _actions
    _actions[:] = [action]
    if is_first:
        threading.Thread(target=_await_end, name="lifeline", daemon=True).start()


def _await_end() -> None:
    while os.read(0, 1):
        pass
    _actions[0]()


def die_with(parent_pid: int) -> None:
    """Be killed by the kernel when the thread that started us ends (Linux; elsewhere nothing happens)."""
    if sys.platform != "linux":
        return
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent_pid:
        os._exit(1)  # it was gone before we asked
