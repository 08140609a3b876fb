"""The filters compiled before the tests, on all processors at a time."""

from __future__ import annotations

import subprocess
import sys

from tests.data import ROOT


def compile_filters() -> None:
    """Fill the folder of compiled filters that `server.compile_cache` names.

    Raises
    ------
    subprocess.CalledProcessError
        a filter does not compile.
    """
    running = [
        subprocess.Popen([sys.executable, "-c", f"from {room} import {name}; {name}()"], cwd=ROOT)
        for room, name in (
            ("core.online.session", "compile_live_kernels"),
            ("core.online.session", "compile_small_kernels"),
            ("core.agreement.windows", "compile_agreement_kernels"),
        )
    ]
    for process in running:
        if process.wait():
            raise subprocess.CalledProcessError(process.returncode, process.args)
