"""Walking direction from horizontal acceleration: velocity, axis, signs, step time."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.calibration.heading import (
    HeadingParams,
    acceleration_axis,
    nearest_sign,
    rest_to_rest_velocity,
    start_direction,
    step_time,
    stride_direction,
    subtract_angles,
    velocity_direction,
)

RATE = 100.0
PARAMS = HeadingParams()
Profile = tuple[np.ndarray, np.ndarray]


def out_and_back(direction: float, bias: complex = 0j) -> np.ndarray:
    """Horizontal acceleration of 6 s out and 6 s back at 1 m/s with 1 s starts and stops, and a bias."""
    speed = np.interp(np.arange(1600) / RATE, [0, 1, 2, 7, 8, 9, 14, 15, 16], [0, 0, 1, 1, 0, -1, -1, 0, 0])
    return np.asarray(np.gradient(speed) * RATE * np.exp(1j * direction) + bias)


@pytest.mark.parametrize("direction", np.linspace(-3.1, 3.1, 7))
def test_velocity_out_less_back_is_the_direction_in_spite_of_a_bias(direction: float) -> None:
    v = rest_to_rest_velocity(out_and_back(direction, 0.05 - 0.03j), True, RATE)
    result = velocity_direction(v, 0, [(200, 700), (900, 1400)], [0.0, np.pi], PARAMS)
    assert result is not None
    assert abs(subtract_angles(result.angle, direction)) < np.radians(1.0)
    assert result.score > 0.99


def test_velocity_that_disagrees_with_itself_gives_no_direction() -> None:
    v = rest_to_rest_velocity(out_and_back(0.3), True, RATE)
    assert velocity_direction(v, 0, [(200, 700), (900, 1400)], [0.0, 0.0], PARAMS) is None
    assert velocity_direction(0.01 * v, 0, [(200, 700)], [0.0], PARAMS) is None
    assert velocity_direction(v, 0, [], [], PARAMS) is None


def test_a_foot_goes_where_each_of_its_strides_goes_in_spite_of_a_bias() -> None:
    """Ten strides of 1.1 s that swing 10 cm outwards, from flat to flat, five ahead and five back."""
    swing = np.linspace(0.0, 2.0 * np.pi, 70)
    ahead, outward = 2.0 * (1.0 - np.cos(swing)), 0.5 * np.sin(swing)
    v = np.concatenate(
        [np.concatenate((sign * (ahead + 1j * outward), np.zeros(40))) for sign in (1,) * 5 + (-1,) * 5]
    )
    a = np.gradient(v) * RATE * np.exp(0.6j) + 0.3 - 0.2j
    flats = np.arange(90, len(v), 110)
    result = stride_direction(a, flats, [(0, 550), (550, 1100)], [0.0, np.pi], RATE, PARAMS)
    assert result is not None
    assert abs(subtract_angles(result.angle, 0.6)) < np.radians(1.0)
    assert result.score > 0.99


@pytest.mark.parametrize("flats", [[], [90], [90, 900]], ids=["none", "one", "too far apart"])
def test_a_foot_without_strides_has_no_direction(flats: list[int]) -> None:
    a = np.ones(1100, complex)
    assert stride_direction(a, np.array(flats, np.int64), [(0, 1100)], [0.0], RATE, PARAMS) is None


@pytest.mark.parametrize("leads", [True, False])
def test_velocity_next_to_a_rest_tells_the_sign(leads: bool) -> None:
    a = out_and_back(0.7)
    remainder, part, turn = ((0.0, 1.0), (110, 700), 0.0) if leads else ((15.0, 16.0), (900, 1490), np.pi)
    result = start_direction(a, remainder, part, turn, leads, RATE, 1.5, PARAMS)
    assert result is not None
    assert abs(subtract_angles(result.angle, 0.7)) < np.radians(2.0)


def test_a_rest_far_from_the_walk_tells_no_sign() -> None:
    assert start_direction(out_and_back(0.7), (0.0, 1.0), (400, 700), 0.0, True, RATE, 1.5, PARAMS) is None


@pytest.mark.parametrize("direction", [-1.2, 0.0, 0.4, 1.5])
def test_axis_of_a_leg_is_where_it_swings_most(direction: float) -> None:
    t = np.arange(1000) / RATE
    a = (3.0 * np.sin(6 * t) + 1j * np.sin(6 * t + 1.3)) * np.exp(1j * direction)
    result = acceleration_axis(a, [(0, 1000)], [0.0], RATE, PARAMS)
    turned_part = acceleration_axis(a * np.exp(0.5j), [(0, 1000)], [0.5], RATE, PARAMS)
    assert abs(subtract_angles(nearest_sign(result.angle, turned_part.angle), turned_part.angle)) < 1e-9
    assert abs(subtract_angles(nearest_sign(result.angle, direction), direction)) < np.radians(8.0)


def test_sway_of_the_trunk_does_not_turn_the_axis() -> None:
    """Sway larger than fore-aft motion, at half its frequency: without step time the axis is lateral."""
    t = np.arange(2000) / RATE
    step = 0.55
    a = (np.sin(2 * np.pi * t / step) + 2.0j * np.sin(np.pi * t / step)) * np.exp(0.4j)
    lateral = acceleration_axis(a, [(0, 2000)], [0.0], RATE, PARAMS)
    along = acceleration_axis(a, [(0, 2000)], [0.0], RATE, PARAMS, [step])
    assert abs(subtract_angles(nearest_sign(lateral.angle, 0.4), 0.4)) > np.radians(60.0)
    assert abs(subtract_angles(nearest_sign(along.angle, 0.4), 0.4)) < np.radians(1.0)


@pytest.mark.parametrize("step", [0.4, 0.55, 0.7, 0.95])
def test_step_time_is_the_period_of_the_vertical_even_with_a_limp(step: float) -> None:
    t = np.arange(1500) / RATE
    up = np.sin(2 * np.pi * t / step) + 0.3 * np.sin(np.pi * t / step + 0.5)
    assert step_time(up, RATE) == pytest.approx(step, abs=0.02)


def test_no_rhythm_no_step_time() -> None:
    assert step_time(np.zeros(1000), RATE) == 0.0
    assert step_time(np.ones(50), RATE) == 0.0
