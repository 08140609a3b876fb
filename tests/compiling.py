"""The filters compiled before the tests, on two processors at a time."""

from __future__ import annotations

import subprocess
import sys

from tests.data import ROOT

PARTS = (("lower_body7",), ("feet_pelvis3", "feet2"))
"""Sets of sensors whose filters have the least in common: about as long either."""


def compile_filters() -> None:
    """Fill the folder of compiled filters that `server.compile_cache` names.

    Raises
    ------
    subprocess.CalledProcessError
        a filter does not compile.
    """
    programs = [[sys.executable, "-c", f"from core.online import warm; warm({sets})"] for sets in PARTS]
    running = [subprocess.Popen(program, cwd=ROOT) for program in programs]
    for process in running:
        if process.wait():
            raise subprocess.CalledProcessError(process.returncode, process.args)
