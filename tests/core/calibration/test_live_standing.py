"""Live standing: moving sensors, duration, vertical."""

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
    """Ten seconds; the listed sensors rotate where they move."""
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
    verdict = judge_standing(recording(foot_l=until(2.0), foot_r=until(5.0)), REST)
    assert verdict.still == {"foot_l", "foot_r"}
    assert verdict.stood_s == pytest.approx(5.0, abs=0.5)
    assert verdict.longest_s == verdict.stood_s


def test_one_that_moves_now_ends_the_standing_of_all() -> None:
    verdict = judge_standing(recording(foot_l=until(0.0), foot_r=~until(7.0)), REST)
    assert verdict.still == {"foot_l"}
    assert verdict.stood_s == 0.0
    assert verdict.longest_s == pytest.approx(7.0, abs=0.5)


def test_a_longer_rest_before_is_told_beside_the_one_that_lasts() -> None:
    middle = np.zeros(N, np.bool_)
    middle[300:350] = True
    verdict = judge_standing(recording(foot_l=middle), REST)
    assert verdict.longest_s == pytest.approx(6.0, abs=0.5)
    assert verdict.stood_s == pytest.approx(3.0, abs=0.5)


def test_nothing_recorded_stands_still_for_no_time() -> None:
    verdict = judge_standing(recording(), REST)
    assert (verdict.still, verdict.stood_s, verdict.longest_s) == (frozenset(), 0.0, 0.0)


def test_the_last_part_is_cut_in_every_signal() -> None:
    whole = recording(foot_l=until(9.0))
    last = cut_last_part(whole, 2.0)
    assert last.t_s.tolist() == whole.t_s[400:].tolist()
    foot = last.sensors["foot_l"]
    assert len(foot.acc) == len(foot.valid) == len(foot.interpolated) == 100
    np.testing.assert_array_equal(foot.gyr, whole.sensors["foot_l"].gyr[400:])


def test_up_is_the_mean_of_the_last_second() -> None:
    inputs = recording(foot_l=until(0.0))
    acc = inputs.sensors["foot_l"].acc.copy()
    acc[:-50] = (9.0, 0.0, 0.0)
    acc[-50:] = (0.0, 3.0, 4.0)
    turned = SensorSignals("", acc, acc, None, until(20.0), until(0.0))
    nothing = SensorSignals("", np.zeros((N, 3)), acc, None, until(20.0), until(0.0))
    pair = UniformRecording(inputs.t_s, RATE, {"foot_l": turned, "foot_r": nothing}, Subject(), "walk", {})
    upward_axes = find_upward_axes(pair)
    assert upward_axes["foot_l"] == pytest.approx([0.0, 0.6, 0.8])
    assert not upward_axes["foot_r"].any()
