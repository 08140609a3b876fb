"""Turns from a yaw rate: angle, duration, direction, and what is no turn; on walks with known arcs."""

from __future__ import annotations

from dataclasses import replace
from math import pi, radians

import numpy as np
import pytest

from sagittal.core.events.lumbar import split_about_vertical
from sagittal.core.events.turns import Turn, body_yaw_rate, find_turns
from sagittal.core.frames import Floats, Segment
from sagittal.core.fusion.orientations import Orientations
from tests.helpers.walks import neura_analysis, simulated

RATE = 100.0


def always(x: Floats) -> np.ndarray:
    return np.ones(len(x), np.bool_)


def bump(angle: float, start: float, seconds: float, n: int = 2000) -> Floats:
    """Yaw rate of one turn with a smooth start and end."""
    t = np.arange(n) / RATE
    u = np.clip((t - start) / seconds, 0.0, 1.0)
    return np.asarray(angle / seconds * (1.0 - np.cos(2 * pi * u)))


def found(name: str, *worn: Segment) -> tuple[Turn, ...]:
    """Turns of a simulated walk from the true orientations of some segments."""
    truth = simulated(name)[1]
    valid = {s: always(truth.t_s) for s in worn}
    take = Orientations(truth.t_s, RATE, {s: truth.q[s] for s in worn}, valid, "truth")
    return find_turns(*body_yaw_rate(take, RATE), RATE)


@pytest.mark.parametrize("angle", [pi, -pi, pi / 2, -2 * pi])
def test_a_turn_has_its_angle_direction_and_peak(angle: float) -> None:
    (turn,) = find_turns(bump(angle, 5.0, 3.0), always(np.zeros(2000)), RATE)
    assert turn.angle_rad == pytest.approx(angle, rel=0.02)
    assert turn.direction == ("left" if angle > 0 else "right")
    assert turn.peak_rad_s == pytest.approx(abs(angle) / 1.5, rel=0.05)
    assert turn.start_s == pytest.approx(5.0, abs=0.6)
    assert turn.end_s == pytest.approx(8.0, abs=0.6)


@pytest.mark.parametrize("seconds", [1.5, 2.0, 3.0, 5.0])
def test_the_edges_of_a_steady_turn_stay_where_they_are(seconds: float) -> None:
    t = np.arange(2000) / RATE
    turning = (t > 5.0) & (t < 5.0 + seconds)
    with_every_stride = radians(40.0) * np.sin(2 * pi * 0.95 * t)
    (turn,) = find_turns(pi / seconds * turning + with_every_stride, always(t), RATE)
    assert turn.start_s == pytest.approx(5.0, abs=0.15)
    assert turn.end_s == pytest.approx(5.0 + seconds, abs=0.15)


def test_a_turn_there_and_one_back_are_two() -> None:
    there, back = find_turns(bump(pi, 3.0, 3.0) + bump(-pi, 9.0, 3.0), always(np.zeros(2000)), RATE)
    assert (there.direction, back.direction) == ("left", "right")


def test_the_swing_of_the_pelvis_is_no_turn() -> None:
    t = np.arange(3000) / RATE
    for stride_hz in (0.6, 0.9, 1.2):
        assert find_turns(radians(40.0) * np.sin(2 * pi * stride_hz * t), always(t), RATE) == ()


def test_a_small_or_endless_change_of_heading_is_no_turn() -> None:
    assert find_turns(bump(radians(35.0), 5.0, 2.0), always(np.zeros(2000)), RATE) == ()
    circle = np.full(6000, radians(20.0))
    assert find_turns(circle, always(circle), RATE) == ()


def test_a_turn_in_which_the_sensor_was_lost_is_not_reported() -> None:
    rate = bump(pi, 5.0, 3.0)
    lost = always(rate)
    lost[620:640] = False
    assert find_turns(rate, lost, RATE) == ()


@pytest.mark.parametrize("seconds", [4.5, 6.0, 6.5, 7.0])
def test_a_turn_cut_by_an_end_of_the_take_is_not_reported(seconds: float) -> None:
    """Half of a turn is no small turn."""
    rate = bump(pi, 5.0, 3.0)
    n = round(seconds * RATE)
    assert find_turns(rate[:n], always(rate[:n]), RATE) == ()
    assert find_turns(rate[:n][::-1], always(rate[:n]), RATE) == ()
    (whole,) = find_turns(rate[:950], always(rate[:950]), RATE)
    assert whole.angle_rad == pytest.approx(pi, rel=0.02)


@pytest.mark.recorded
def test_a_real_turn_cut_by_the_end_of_the_take_is_not_reported() -> None:
    take = neura_analysis()
    assert take.fused is not None
    rate, valid = body_yaw_rate(take.fused, take.fused.rate_hz)
    (whole,) = find_turns(rate, valid, take.fused.rate_hz)
    assert np.degrees(abs(whole.angle_rad)) == pytest.approx(191.0, abs=3.0)
    n = round(15.3 * take.fused.rate_hz)
    assert find_turns(rate[:n], valid[:n], take.fused.rate_hz) == ()


@pytest.mark.parametrize("n", [0, 1, 10, 40])
def test_a_take_of_a_moment_has_none(n: int) -> None:
    assert find_turns(np.full(n, 3.0), np.ones(n, np.bool_), RATE) == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    "worn", [("pelvis",), ("thigh_l", "thigh_r"), ("shank_l", "shank_r"), ("foot_l", "foot_r")]
)
def test_any_segment_shows_the_turns_of_a_walk(worn: tuple[Segment, ...]) -> None:
    listed = found("fast_with_turns", *worn)
    assert [t.direction for t in listed] == ["left", "right", "right"]
    for turn in listed:
        assert abs(turn.angle_rad) == pytest.approx(pi, abs=radians(6.0))


def test_one_foot_alone_tells_no_turns() -> None:
    assert found("fast_with_turns", "foot_l") == ()


@pytest.mark.slow
def test_a_turn_on_the_spot_is_found_and_a_straight_walk_has_none() -> None:
    assert len(found("five_minutes", "pelvis")) == 12
    for straight in ("slow", "comfortable", "elderly", "hemiparetic", "parkinson"):
        assert found(straight, "pelvis") == ()


def test_a_trunk_sensor_alone_shows_them_without_calibration() -> None:
    signals = simulated("fast_with_turns")[0].sensors["pelvis"]
    listed = find_turns(split_about_vertical(signals, RATE)[1], signals.valid, RATE)
    assert [round(np.degrees(t.angle_rad) / 10) for t in listed] == [18, -18, -18]


def test_the_steadiest_sensor_that_was_there_is_taken() -> None:
    truth = simulated("fast_with_turns")[1]
    gone = np.zeros(len(truth.t_s), np.bool_)
    take = Orientations(
        truth.t_s,
        RATE,
        {s: truth.q[s] for s in ("pelvis", "shank_l", "shank_r")},
        {"pelvis": gone, "shank_l": ~gone, "shank_r": ~gone},
        "truth",
    )
    assert len(find_turns(*body_yaw_rate(take, RATE), RATE)) == 3
    nothing = replace(take, q={}, valid={})
    assert find_turns(*body_yaw_rate(nothing, RATE), RATE) == ()
