"""Wear: gaps and removal to the frame, upright and forward directions."""

from __future__ import annotations

from dataclasses import replace
from math import cos, radians, sin

import numpy as np
import pytest

from sagittal.core.activity.frames import PER_MINUTE, Frames, Singles
from sagittal.core.activity.params import UprightParams, WearParams
from sagittal.core.activity.wear import (
    Wear,
    describe_period,
    find_forward,
    find_upright,
    find_wear,
    group_periods,
)
from sagittal.core.frames import GRAVITY
from tests.core.activity.frames_of_day import make_frames

WORN = WearParams()
UPRIGHT = UprightParams()


def laid_down(minutes: int, first: int = 10, source: int = 60) -> Frames:
    """An hour with the sensor removed for so many minutes."""
    frames = make_frames(source * PER_MINUTE)
    frames.sd[first : first + minutes] = frames.wobble[first : first + minutes] = 0.0
    return frames


def test_what_lies_still_for_half_an_hour_is_off() -> None:
    wear = find_wear(laid_down(30), WORN)
    assert wear.off == ((6000, 24000),)
    assert wear.worn == ((0, 6000), (24000, 36000))
    assert wear.gaps == ()
    assert find_wear(laid_down(29), WORN) == Wear((), (), ((0, 36000),))


def test_the_second_in_which_it_was_laid_down_and_taken_up_is_found() -> None:
    frames = laid_down(30)
    frames.spread[5900:6000] = frames.spread[24000:24050] = 0.0
    frames.spread[5000:5890] = 0.0
    assert find_wear(frames, WORN).off == ((5900, 24050),)
    frames.valid[5990] = False
    assert find_wear(frames, WORN).off == ((5991, 24050),)


def test_a_sleeper_who_breathes_or_moves_on_two_axes_wears_it() -> None:
    breathes, turns, one = laid_down(30), laid_down(30), laid_down(30)
    breathes.wobble[:, 1] = WORN.wobble
    turns.sd[:, :2] = WORN.sd
    one.sd[:, 0] = 1.0
    assert find_wear(breathes, WORN).off == find_wear(turns, WORN).off == ()
    assert find_wear(one, WORN).off == ((6000, 24000),)
    unknown = laid_down(30)
    unknown.sd[20] = np.nan
    assert find_wear(unknown, WORN).off == ()


def test_a_hole_of_two_seconds_is_a_gap_and_never_off() -> None:
    frames = laid_down(30)
    frames.valid[100:119] = False
    frames.valid[200:220] = False
    frames.valid[7000:7100] = False
    wear = find_wear(frames, WORN)
    assert wear.gaps == ((200, 220), (7000, 7100))
    assert wear.off == ((6000, 7000), (7100, 24000))
    assert wear.worn == ((0, 200), (220, 6000), (24000, 36000))


def test_periods_are_parted_by_half_an_hour() -> None:
    shortest = WORN.still_min * PER_MINUTE
    joined = Wear((), (), ((0, 100), (99 + shortest, 50000)))
    assert group_periods(joined, WORN) == ((0, 50000),)
    apart = Wear((), (), ((0, 100), (100 + shortest, 50000)))
    assert group_periods(apart, WORN) == apart.worn
    assert group_periods(Wear((), (), ()), WORN) == ()


def test_up_is_told_by_four_seconds_of_walking_else_by_the_first_rest() -> None:
    frames = make_frames(600)
    frames.gravity[:300] = (GRAVITY, 0.0, 0.0)
    walking = np.zeros(600, np.bool_)
    walking[400:440] = True
    axis, method = find_upright(frames, walking, (0, 600), UPRIGHT)
    assert method == "walking"
    assert axis == pytest.approx([0.0, 0.0, 1.0])
    walking[439] = False
    assert find_upright(frames, walking, (0, 600), UPRIGHT) == (None, "none")
    frames.spread[100:149] = 0.0
    assert find_upright(frames, walking, (0, 600), UPRIGHT) == (None, "none")
    frames.spread[100:150] = 0.0
    axis, method = find_upright(frames, walking, (50, 600), UPRIGHT)
    assert method == "first_rest"
    assert axis == pytest.approx([1.0, 0.0, 0.0])
    assert find_upright(frames, walking, (120, 600), UPRIGHT) == (None, "none")


def test_one_odd_sample_does_not_turn_what_is_up() -> None:
    frames = make_frames(100)
    frames.gravity[::10] = (3.0 * GRAVITY, 0.0, 0.0)
    axis, _ = find_upright(frames, np.ones(100, np.bool_), (0, 100), UPRIGHT)
    assert axis == pytest.approx([0.0, 0.0, 1.0])


def lean(*tops_deg: tuple[float, float]) -> Singles:
    """Gravity of leans forward (x) by so many degrees, in the direction given: upright, leaning, upright."""
    gravity = np.tile(np.array([0.0, 0.0, GRAVITY], np.float32), (3 * len(tops_deg), 1))
    for i, (deg, direction) in enumerate(tops_deg):
        a, b = radians(deg), radians(direction)
        gravity[3 * i + 1] = GRAVITY * np.array([-sin(a) * cos(b), -sin(a) * sin(b), cos(a)])
    return gravity


@pytest.mark.parametrize(
    ("leans", "forward", "count"),
    [
        (((30.0, 0.0), (20.0, 0.0)), (1.0, 0.0, 0.0), 2),
        (((30.0, 30.0), (30.0, -30.0)), (1.0, 0.0, 0.0), 2),
        (((30.0, 0.0),), None, 1),
        (((30.0, 0.0), (11.0, 0.0)), None, 1),
        (((30.0, 0.0), (30.0, 180.0)), None, 2),
        (((30.0, 60.0), (30.0, -60.0)), None, 2),
    ],
)
def test_forward_is_where_at_least_two_leans_go(
    leans: tuple[tuple[float, float], ...], forward: tuple[float, ...] | None, count: int
) -> None:
    position = [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(len(leans))]
    result, observations = find_forward(lean(*leans), np.array([0.0, 0.0, 1.0]), position, UPRIGHT)
    assert observations == count
    assert result is None if forward is None else result == pytest.approx(forward, abs=1e-6)


def test_a_period_is_described_in_plain_numbers() -> None:
    text = describe_period(1.0, 2.0, np.array([0.0, 0.0, 1.0]), None, "walking", 3)
    assert (text.start_s, text.end_s, text.up, text.forward) == (1.0, 2.0, (0.0, 0.0, 1.0), None)
    assert (text.method, text.leans) == ("walking", 3)
    assert replace(text, forward=(1.0, 0.0, 0.0)) == describe_period(
        1.0, 2.0, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), "walking", 3
    )
