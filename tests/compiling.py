"""The filters compiled before the tests, on two processors at a time."""

from __future__ import annotations

import subprocess
import sys
from typing import Final

from tests.data import ROOT

ORDERS: Final = (
    (("core.online.session", "compile_live_kernels"),),
    (
        ("core.body.l7s.poses", "compile_l7s_kernel"),
        ("core.events", "compile_foot_contact_kernel"),
        ("core.agreement.slips", "compile_agreement_kernels"),
        ("core.quality.stuck", "compile_stuck_kernel"),
        ("core.timeline.live", "compile_axis_kernels"),
    ),
)
"""What each process compiles, in order: the first takes half a minute for the filter of seven sensors,
and reads from the folder what the second has done meanwhile."""


def compile_filters() -> None:
    """Fill the folder of compiled filters that `server.compile_cache` names.

    Raises
    ------
    subprocess.CalledProcessError
        a filter does not compile.
    """
    running = [
        subprocess.Popen(
            [sys.executable, "-c", "\n".join(f"from {room} import {name}; {name}()" for room, name in order)],
            cwd=ROOT,
        )
        for order in ORDERS
    ]
    for process in running:
        if process.wait():
            raise subprocess.CalledProcessError(process.returncode, process.args)
