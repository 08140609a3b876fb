"""The filters compiled before the tests, on two processors at a time."""

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
        subprocess.Popen(
            [sys.executable, "-c", f"from core.online.session import {name}; {name}()"], cwd=ROOT
        )
        for name in ("compile_live_kernels", "compile_small_kernels")
    ]
    for process in running:
        if process.wait():
            raise subprocess.CalledProcessError(process.returncode, process.args)
