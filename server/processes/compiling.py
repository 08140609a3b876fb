"""Compiles all filters in two parallel processes, once per user and version."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final

import sagittal
from sagittal.server.storage.compile_cache import VARIABLE, has_compiled_filters

Order = tuple[tuple[str, str], ...]
"""Modules and their functions that compile filters, in order."""

OFFLINE: Final[tuple[Order, Order]] = (
    (("sagittal.core.body.estimate", "compile_erkf_kernels"),),
    (
        ("sagittal.core.fusion.attitude", "compile_attitude_kernel"),
        ("sagittal.core.quality.stuck", "compile_stuck_kernel"),
        ("sagittal.core.agreement.slips", "compile_agreement_kernels"),
        ("sagittal.core.angles.kernel", "compile_angle_kernel"),
        ("sagittal.core.signals.peaks", "compile_peak_kernel"),
        ("sagittal.core.signals.rest", "compile_rest_kernels"),
        ("sagittal.core.body.l7s.inputs", "compile_gravity_kernel"),
        ("sagittal.core.events", "compile_foot_contact_kernel"),
        ("sagittal.core.events", "compile_foot_way_kernel"),
    ),
)
"""Filters for the analysis of a walk, divided over two processes: the ErKF takes as long as all others."""

ALL: Final[tuple[Order, Order]] = (
    (*OFFLINE[0], ("sagittal.core.online.session", "compile_live_kernels")),
    (
        ("sagittal.core.body.l7s.poses", "compile_l7s_kernel"),
        ("sagittal.core.timeline.live", "compile_axis_kernels"),
        *OFFLINE[1],
    ),
)
"""Likewise with those for few sensors and live trials, which load shared ones from the folder: hence first
what live trials need first.
"""


def compile_filters(orders: tuple[Order, Order] = ALL) -> None:
    """Fill the folder of compiled filters given by `sagittal.server.storage.compile_cache`.

    Raises
    ------
    subprocess.CalledProcessError
        a filter does not compile.
    """
    # location of the package, installed or not
    root = str(Path(sagittal.__file__).parent.parent)
    searched = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    running = [
        subprocess.Popen(  # noqa: S603 - our own modules, named above
            [sys.executable, "-c", _write_script(order)],
            env={**os.environ, "PYTHONPATH": searched},
            stdin=subprocess.PIPE,  # closed with our end, even when killed, so that nobody waits for it
        )
        for order in orders
    ]
    ended = [process.wait() for process in running]
    for process in running:
        if process.stdin:
            process.stdin.close()
    for process, code in zip(running, ended, strict=True):
        if code:
            raise subprocess.CalledProcessError(code, process.args)


def _write_script(order: Order) -> str:
    # a compiler produces little garbage among many objects: collection takes a sixth of the time; without it
    # such a process ends with 470 MB instead of 350
    lines = [
        "import gc, os; gc.disable()",
        "from sagittal.server.processes.lifeline import call_when_parent_ends",
        "call_when_parent_ends(lambda: os._exit(1))",
    ]
    lines += [f"from {room} import {name}; {name}()" for room, name in order]
    return "\n".join(lines)


def compile_filters_once(orders: tuple[Order, Order] = ALL) -> None:
    """Compile the filters if the folder is empty; concurrent callers wait for the one that compiles.

    Filters that fail here are compiled at their first call, where the error is raised.
    """
    folder = Path(os.environ[VARIABLE])
    with suppress(OSError, subprocess.CalledProcessError):
        folder.mkdir(parents=True, exist_ok=True)
        # the holder of the lock compiles; it is released when that process ends in any way
        lock = os.open(folder, os.O_RDONLY)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not has_compiled_filters():
                compile_filters(orders)
        finally:
            os.close(lock)


def is_compiling() -> bool:
    """Whether another process is currently filling the folder, so that startup waits for it."""
    try:
        lock = os.open(Path(os.environ[VARIABLE]), os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(lock)
    return False
