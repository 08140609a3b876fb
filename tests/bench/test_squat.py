"""What the sensitivity analysis of a squat costs, against plain Python in the same run."""

from __future__ import annotations

import sys

import pytest

from core.squat.sensitivity import PARAMETERS, _run
from server.commands.sensitivity import simulate_case
from tests.bench.pairs import in_pairs, plain_python

pytestmark = pytest.mark.bench


def test_24_parameters_up_and_down_in_five_seconds_of_a_quiet_core() -> None:
    """48 runs of half a minute of squats: 1.6 s of a core that does the yardstick in 12 ms, limit 2.4 s."""
    case = simulate_case(1, "right")
    assert len(case.gyr) > 3000

    def runs() -> None:
        for _ in range(2 * len(PARAMETERS)):
            _run(case, case.geometry, case.mounts, None)

    runs()
    ours, yardstick, ratio = in_pairs(runs, plain_python, times=3)
    sys.stdout.write(
        f"sensitivity {ours:.2f} s, {ratio:.0f} times {1e3 * yardstick:.0f} ms of plain Python\n"
    )
    assert ratio < 200.0
