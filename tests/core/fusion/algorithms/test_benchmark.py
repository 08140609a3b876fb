"""Reading and scoring recordings with a reference."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest

from sagittal.core.errors import FormatError, SignalError
from sagittal.core.fusion.algorithms.benchmark import find_rest, read_trial, run_trial, score_orientation
from sagittal.core.rotation import about, multiply
from tests.core.fusion.algorithms.motion import trial_bytes


def test_a_turn_about_the_vertical_is_heading_and_one_about_the_horizontal_inclination() -> None:
    trial = read_trial("a", trial_bytes())
    for axis, name in ((2, "heading"), (0, "inclination")):
        off = multiply(about(axis, 0.1), trial.reference)
        score = score_orientation(off, trial)
        assert score.total == pytest.approx(0.1, abs=1e-9)
        assert getattr(score, name) == pytest.approx(0.1, abs=1e-9)
        second = {"heading", "inclination"} - {name}
        assert getattr(score, second.pop()) == pytest.approx(0.0, abs=1e-7)


def test_the_bias_of_the_rest_is_taken_off_or_left() -> None:
    trial = read_trial("a", trial_bytes())
    assert find_rest(trial).gyr[0, 0] == pytest.approx(0.01)
    assert find_rest(trial, with_bias=True).gyr[0].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.slow
def test_a_filter_without_noise_is_exact_on_what_stays_in_place() -> None:
    """But for the first sample, whose turn the reference has already made: 0.6°."""
    trial = read_trial("a", trial_bytes())
    assert np.degrees(score_orientation(run_trial("mahony_2008", trial), trial).total) < 1.0


def test_a_reference_that_is_no_rotation_is_lost() -> None:
    trial = read_trial("a", trial_bytes())
    q = trial.reference.copy()
    q[-3:] *= np.array([[0.0], [2.0], [1.0]])
    second_trial = read_trial("a", trial_bytes(opt_quat=q))
    assert np.isnan(second_trial.reference[-3:-1]).all()
    assert (second_trial.reference[-1] == q[-1]).all()


def test_what_is_no_trial_is_refused() -> None:
    single = BytesIO()
    np.save(single, np.zeros((3, 3)))
    locked = bytearray(trial_bytes())
    for mark, flags in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        locked[locked.find(mark) + flags] |= 1
    wrong = (
        {"imu_acc": np.zeros((3, 3))},
        {"imu_gyr": np.array(5.0)},
        {"imu_gyr": np.full((3, 3), "x")},
        {"movement": np.array(True)},
        *({"sampling_rate": np.array(rate)} for rate in (np.nan, 0.0, -5.0, 1e300, "fast", [100.0, 50.0])),
    )
    broken = (trial_bytes(6.0, 2.0, **x) for x in wrong)
    for content in (b"nothing", b"", single.getvalue(), bytes(locked), *broken):
        with pytest.raises(FormatError) as caught:
            read_trial("a", content)
        assert caught.value.code == "not_a_trial"
    with pytest.raises(SignalError) as unrested:
        find_rest(read_trial("a", trial_bytes(rest_s=0.5)))
    assert unrested.value.code == "no_rest"
