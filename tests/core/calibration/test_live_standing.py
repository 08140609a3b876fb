"""Standing as it is seen from now: who is still, for how long, and which way is up."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.calibration.live_standing import cut_last_part, find_upward_axes, judge_standing
from sagittal.core.frames import GRAVITY, Bools, Segment
from sagittal.core.signals.recording import SensorSignals, Subject, UniformRecording
from sagittal.core.signals.rest import RestParams

RATE = 50.0
N = 500
REST = RestParams()


def recording(**moving: Bools) -> UniformRecording:
    """Ten seconds; each sensor turns where it is said to move."""
    sensors: dict[Segment, SensorSignals] = {}
    for segment, moves in moving.items():
        gyr = np.zeros((N, 3))
        gyr[moves, 0] = 2.0 + np.sin(np.arange(N))[moves]
        acc = np.tile([0.0, 0.0, GRAVITY], (N, 1))
        yes = np.ones(N, np.bool_)
        sensors[segment] = SensorSignals("", acc, gyr, None, yes, ~yes)  # type: ignore[index]
    return UniformRecording(np.arange(N) / RATE, RATE, sensors, Subject(), "walk", {})


def until(end_s: float) -> Bools:
    return np.asarray(np.arange(N) < end_s * RATE)


def test_all_have_stood_since_the_last_one_stopped() -> None:
    found = judge_standing(recording(foot_l=until(2.0), foot_r=until(5.0)), REST)
    assert found.still == {"foot_l", "foot_r"}
    assert found.stood_s == pytest.approx(5.0, abs=0.5)
    assert found.longest_s == found.stood_s


def test_one_that_moves_now_ends_the_standing_of_all() -> None:
    found = judge_standing(recording(foot_l=until(0.0), foot_r=~until(7.0)), REST)
    assert found.still == {"foot_l"}
    assert found.stood_s == 0.0
    assert found.longest_s == pytest.approx(7.0, abs=0.5)


def test_a_longer_rest_before_is_told_beside_the_one_that_lasts() -> None:
    middle = np.zeros(N, np.bool_)
    middle[300:350] = True
    found = judge_standing(recording(foot_l=middle), REST)
    assert found.longest_s == pytest.approx(6.0, abs=0.5)
    assert found.stood_s == pytest.approx(3.0, abs=0.5)


def test_nothing_recorded_stands_still_for_no_time() -> None:
    found = judge_standing(recording(), REST)
    assert (found.still, found.stood_s, found.longest_s) == (frozenset(), 0.0, 0.0)


def test_the_last_part_is_cut_in_every_signal() -> None:
    whole = recording(foot_l=until(9.0))
    last = cut_last_part(whole, 2.0)
    assert last.t_s.tolist() == whole.t_s[400:].tolist()
    foot = last.sensors["foot_l"]
    assert len(foot.acc) == len(foot.valid) == len(foot.interpolated) == 100
    np.testing.assert_array_equal(foot.gyr, whole.sensors["foot_l"].gyr[400:])


def test_up_is_the_mean_of_the_last_second() -> None:
    given = recording(foot_l=until(0.0))
    acc = given.sensors["foot_l"].acc.copy()
    acc[:-50] = (9.0, 0.0, 0.0)
    acc[-50:] = (0.0, 3.0, 4.0)
    turned = SensorSignals("", acc, acc, None, until(20.0), until(0.0))
    nothing = SensorSignals("", np.zeros((N, 3)), acc, None, until(20.0), until(0.0))
    both = UniformRecording(given.t_s, RATE, {"foot_l": turned, "foot_r": nothing}, Subject(), "walk", {})
    found = find_upward_axes(both)
    assert found["foot_l"] == pytest.approx([0.0, 0.6, 0.8])
    assert not found["foot_r"].any()
