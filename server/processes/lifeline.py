"""Ends child processes together with their parent.

The parent holds the other end of our standard input and never writes to it, so end of file means that it is
gone, for any reason. On Linux the kernel also kills us, even in the middle of a computation.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable

PR_SET_PDEATHSIG = 1
"""prctl(2): signal on the death of the parent; linux/prctl.h."""


_actions: list[Callable[[], None]] = []


def call_when_parent_ends(action: Callable[[], None]) -> None:
    """Call `action` in a thread when the parent has ended; replaces an earlier action."""
    is_first = not _actions
    _actions[:] = [action]
    if is_first:
        threading.Thread(target=_await_end, name="lifeline", daemon=True).start()


def _await_end() -> None:
    while os.read(0, 1):
        pass
    _actions[0]()


def die_with(parent_pid: int) -> None:
    """Ask the kernel to kill this process when the thread that started it ends (Linux only)."""
    if sys.platform != "linux":
        return
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent_pid:
        os._exit(1)  # it ended before we asked
