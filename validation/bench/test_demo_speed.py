"""How long a newcomer waits at the second start of the demo, when the filters are compiled."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence

import sagittal
from sagittal.server.demo.clinic import VISITS, DemoVisit, record
from sagittal.server.processes.compiling import compile_filters_once
from tests.data import ROOT

LIMIT = 1.6
"""Time until all visits are analysed, over the time in which one process simulates and analyses them: 1.4.
The start, of about 3 s, weighs the more the faster analyses become."""


def run_demo() -> float:
    """Start the demo, stop it when all visits are analysed; return its reported seconds."""
    process = subprocess.Popen(
        [sys.executable, "-m", "sagittal.server.main", "demo"], cwd=ROOT, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"}, start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    message = []
    try:
        for line in process.stdout:
            message.append(line)
            match = re.search(r"(\d+) of (\d+) sessions analysed \((\d+) s\)", line)
            if match and match[1] == match[2]:
                return float(match[3])
        raise AssertionError("the demo ended:\n" + "".join(message))
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(30)
        process.stdout.close()


def analyse(visits: Sequence[DemoVisit]) -> float:
    """Simulate and analyse visits one after the other in this process; seconds that took."""
    began = time.perf_counter()
    for visit in visits:
        sagittal.analyse(record(visit).recording)
    return time.perf_counter() - began


def test_the_second_start_of_the_demo_shows_all_visits_soon() -> None:
    compile_filters_once()
    analyse(VISITS[:1])
    assert run_demo() / analyse(VISITS) < LIMIT
