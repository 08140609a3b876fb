"""Cost of a calibration with all checks, against plain Python in the same run."""

from __future__ import annotations

import sys

from sagittal.core.agreement import check_agreement
from sagittal.core.calibration import calibrate
from sagittal.core.calibration.score import score_calibration
from tests.helpers.pairs import in_pairs, plain_python
from tests.helpers.walks import cut, simulated


def test_two_minutes_with_all_checks_in_one_and_a_half_seconds_of_a_quiet_core() -> None:
    """Limit 1.5 s of a core that does the yardstick in 12 ms, including consistency checks."""
    recording = cut(simulated("five_minutes")[0], 0.0, 120.0)
    assert len(recording.sensors) == 7

    def run() -> None:
        agreed = check_agreement(recording)
        score_calibration(calibrate(agreed.recording), None, agreed)

    run()
    ours, yardstick, ratio = in_pairs(run, plain_python, times=3)
    sys.stdout.write(
        f"calibration and checks {ours:.2f} s, {ratio:.0f} times {1e3 * yardstick:.0f} ms of plain Python\n"
    )
    assert ratio < 125.0
