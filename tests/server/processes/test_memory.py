"""Memory that a process has freed goes back to the machine."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.data import ROOT

HOLES = """
from pathlib import Path
import numpy as np
from sagittal.core.signals.memory import give_memory_back
from sagittal.server.processes.memory import share_allocator
share_allocator()
import pyarrow as pa
assert pa.default_memory_pool().backend_name == "system"

def held_mb():
    line = next(x for x in Path("/proc/self/status").read_text().splitlines() if x.startswith("RssAnon"))
    return int(line.split()[1]) / 1024

# below what the C library maps by itself, every other one kept
pieces = [np.ones(12_000) for _ in range(1000)]
kept = pieces[::2]
del pieces
before = held_mb()
give_memory_back()
print(before - held_mb())
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
def test_freed_memory_between_kept_memory_goes_back() -> None:
    result = subprocess.run(
        [sys.executable, "-c", HOLES], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert float(result.stdout) >= 30.0
