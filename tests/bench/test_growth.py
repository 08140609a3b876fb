"""How time and memory of an analysis grow with the length of a take; written into docs/performance.md."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from tests.accuracy.report import record_speed
from tests.data import ROOT

pytestmark = [
    pytest.mark.bench,
    pytest.mark.timeout(1800),
    pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory is read from /proc"),
]

MAKE = """
import sys
from math import pi
from pathlib import Path
from core.formats import write_recording
from core.simulate import Arc, Stand, Straight, simulate

lap = (Straight(20.0, 0.64, 0.54), Arc(1.5, pi, 0.52, 0.56)) * 2
for laps in map(int, sys.argv[2:]):
    made = simulate((Stand(8.0), *lap * laps, Stand(5.0)), seed=3)
    Path(sys.argv[1], f"{laps}.parquet").write_bytes(write_recording(made.recording))
"""

ANALYSE = """
import json, sys, time
from pathlib import Path
from core.formats import list_source_files
from server.services import analysing

def analysed(path):
    stages, began = [], time.process_time()
    progress = lambda name, share: stages.append((name, time.process_time()))
    files = analysing.run(list(list_source_files([path])), None, None, progress)
    ended = time.process_time()
    ends = [t for _, t in stages[1:]] + [ended]
    return files, ended - began, {name: end - start for (name, start), end in zip(stages, ends)}

warm, path = map(Path, sys.argv[1:])
analysed(warm)
files, cpu_s, stages = analysed(path)
# not ru_maxrss: that begins with the peak of the process that started this one
peak = next(x for x in Path("/proc/self/status").read_text().splitlines() if x.startswith("VmHWM"))
result = json.loads(files["analysis.json"])
print(json.dumps({
    "cpu_s": cpu_s, "stages": stages, "peak_mb": int(peak.split()[1]) / 1024,
    "parameters": sum(p["mean"] is not None for p in result["parameters"]),
}))
"""

LAPS: Final = {1: 57.0, 14: 623.0}
"""Laps of 43.5 s → about the take's length in s: 1 and 10 min."""

SLOWER: Final = 1.6
"""A second of ten minutes may take so much longer than a second of one minute."""

MOST_MB: Final = 600.0
"""Of the whole process, for ten minutes."""


def run(script: str, *words: str) -> str:
    """What a script prints that runs in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", script, *words],
        cwd=ROOT, capture_output=True, text=True, check=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    return done.stdout


def test_time_and_memory_grow_with_the_length_and_no_faster(tmp_path: Path) -> None:
    run(MAKE, str(tmp_path), *map(str, LAPS))
    found = {
        laps: json.loads(run(ANALYSE, str(tmp_path / "1.parquet"), str(tmp_path / f"{laps}.parquet")))
        for laps in LAPS
    }
    rows = [
        [
            f"{length / 60:.0f} min",
            f"{x['cpu_s']:.1f} s",
            f"{length / x['cpu_s']:.0f} ×",
            f"{1e3 * x['cpu_s'] / length:.1f} ms",
            f"{x['stages']['poses']:.1f} s",
            f"{x['peak_mb']:.0f} MB",
        ]
        for (laps, length), x in zip(LAPS.items(), found.values(), strict=True)
    ]
    slope = (found[14]["peak_mb"] - found[1]["peak_mb"]) / (LAPS[14] - LAPS[1]) * 60.0
    record_speed(
        "Length of a take",
        ("walk of seven sensors, 100 Hz", "CPU", "real time", "CPU a second", "of it poses", "peak memory"),
        rows,
        f"From reading the file to writing the results, filters compiled. Memory grows by {slope:.0f} MB a "
        "minute; the process itself with all libraries is most of what one minute takes.",
    )
    assert all(x["parameters"] > 50 for x in found.values())
    assert found[14]["cpu_s"] / LAPS[14] <= SLOWER * found[1]["cpu_s"] / LAPS[1]
    assert found[14]["peak_mb"] <= MOST_MB
