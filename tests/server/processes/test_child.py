"""Long computations run at lower priority than pages from the start."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sagittal.server.processes.child import BEHIND, FAR_BEHIND, end_process, start_child, start_module
from sagittal.server.settings import Settings


@pytest.mark.parametrize("behind", [0, BEHIND, FAR_BEHIND])
def test_a_process_is_nicer_than_its_starter_before_it_runs(tmp_path: Path, behind: int) -> None:
    child, line = start_child("sagittal.server.worker.child", Settings(data_dir=tmp_path), behind)
    module = start_module("sagittal.server.worker.worker", Settings(data_dir=tmp_path), behind)
    try:
        own = os.getpriority(os.PRIO_PROCESS, 0)
        for process in (child, module):
            assert os.getpriority(os.PRIO_PROCESS, process.pid) == min(own + behind, 19)
    finally:
        line.close()
        end_process(child)
        end_process(module)
