"""A process of ours ends with its starter at any moment, also while it still imports."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.data import ROOT
from tests.faults.clinic import alive, until

START = """
import sys
from pathlib import Path
from sagittal.server.processes.child import start_child, start_module
from sagittal.server.settings import Settings

made = {start}("slow_import", Settings(data_dir=Path(sys.argv[1])))
print(getattr(made, "pid", None) or made[0].pid, flush=True)
sys.stdin.read()
"""
SLOW = """
import pathlib, threading
pathlib.Path("importing").touch()
threading.Event().wait()  # an import that takes for ever
"""


@pytest.mark.parametrize("start", ["start_child", "start_module"])
def test_a_process_that_still_imports_ends_with_its_killed_starter(tmp_path: Path, start: str) -> None:
    (tmp_path / "slow_import.py").write_text(SLOW)
    parent = subprocess.Popen(
        [sys.executable, "-c", START.format(start=start), str(tmp_path)],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": f"{ROOT}:{tmp_path}"},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    try:
        until((tmp_path / "importing").exists)
        parent.kill()
        until(lambda: not alive(child), 20.0)
    finally:
        if alive(child):
            os.kill(child, signal.SIGKILL)
        parent.kill()
        parent.communicate()
