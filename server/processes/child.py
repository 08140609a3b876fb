"""Child processes with a channel: starting one, and entry point in the child.

    process, line = start_child("sagittal.server.worker.child", settings)       # in the parent
    line, settings = enter_child()                                      # in the child, first statement

The child ends with its parent (lifeline.py), ignores Ctrl-C and is limited to the memory of the settings.
"""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import socket
import subprocess
import sys
from typing import Final

from sagittal.server.log import start_log
from sagittal.server.processes.channel import Channel
from sagittal.server.processes.environment import make_environment
from sagittal.server.processes.lifeline import call_when_parent_ends, die_with
from sagittal.server.settings import Settings, load_settings

BEHIND: Final = 5
"""Increment of the nice value for workers, and again for their compute processes, so that pages and live
trials have priority, then leases. No more, since jobs must progress on a busy machine.
"""
BOUND: Final = "sagittal.server.processes.bound"
FAR_BEHIND: Final = 2 * BEHIND
"""Increment for long computations started by the web server."""


def start_child(
    module: str, settings: Settings, niceness: int = 0
) -> tuple[subprocess.Popen[bytes], socket.socket]:
    """Run a module that begins with `enter_child`; return the process and our end of the channel.

    Parameters
    ----------
    niceness : increment of the nice value relative to this process, applied at start.
    """
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(  # noqa: S603 - our own interpreter and module; a fork takes milliseconds
            [sys.executable, "-m", BOUND, module, str(theirs.fileno()), str(os.getpid())],
            env=make_environment(settings),
            stdin=subprocess.PIPE,
            pass_fds=[theirs.fileno()],
        )
    _put_behind(process.pid, niceness)
    return process, ours


def start_module(module: str, settings: Settings, niceness: int = 0) -> subprocess.Popen[bytes]:
    """Run one of our modules without a channel; it ends with this process (lifeline.py).

    A module that needs to clean up first calls `call_when_parent_ends`.

    Parameters
    ----------
    niceness : increment of the nice value relative to this process, applied at start.
    """
    process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
        [sys.executable, "-m", BOUND, module], env=make_environment(settings), stdin=subprocess.PIPE
    )
    _put_behind(process.pid, niceness)
    return process


def _put_behind(pid: int, niceness: int) -> None:
    """Increase a process's nice value relative to this one, if it is still running."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, pid, os.getpriority(os.PRIO_PROCESS, 0) + niceness)


def end_process(process: subprocess.Popen[bytes]) -> None:
    """Kill a process, wait for it and close its standard input."""
    process.kill()
    process.wait()
    if process.stdin:
        process.stdin.close()


def enter_child() -> tuple[Channel, Settings]:
    """Open the channel given by `start_child`, tie this process's lifetime to the parent's and limit memory.

    Returns
    -------
    The channel to the parent, and the settings, read from the environment.
    """
    end = socket.socket(fileno=int(sys.argv[1]))
    die_with(int(sys.argv[2]))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole process group; the parent ends us
    call_when_parent_ends(lambda: os._exit(1))
    settings = load_settings()
    start_log(settings)
    if settings.child_memory_bytes:
        resource.setrlimit(resource.RLIMIT_AS, (settings.child_memory_bytes,) * 2)
    return Channel(end), settings
