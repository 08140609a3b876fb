"""Cost of the sensitivity analysis of a squat, against plain Python in the same run."""

from __future__ import annotations

import sys

from sagittal.core.squat.sensitivity import analyse_sensitivity
from sagittal.server.commands.science.sensitivity import simulate_case
from tests.helpers.pairs import in_pairs, plain_python

MOST_PIECES = 300.0
"""Five seconds of a core that does a piece in 17 ms."""


def test_24_parameters_up_and_down_in_five_seconds_of_a_core() -> None:
    """Half a minute of squats of a leg at 100 Hz, by steps and by shares: 69 runs of the chain.

    2.3 s of a core that does the yardstick in 12 ms; 24 × 2 of them take two thirds.
    """
    case = simulate_case(1, "right")
    assert len(case.gyr) > 3000
    analyse_sensitivity(case)
    ours, yardstick, ratio = in_pairs(lambda: analyse_sensitivity(case), plain_python, times=3)
    sys.stdout.write(
        f"sensitivity {ours:.2f} s of CPU, {ratio:.0f} times {1e3 * yardstick:.0f} ms of plain Python\n"
    )
    assert ratio < MOST_PIECES
