"""Vertical, bias and the choice of a rest; every way in which a rest can be missing has its code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.calibration.standing import (
    choose_rest,
    find_rests,
    measure_standing,
    stand_all,
    vertical_frame,
)
from sagittal.core.errors import SignalError
from sagittal.core.frames import Floats
from sagittal.core.signals.recording import SensorSignals, Subject, UniformRecording
from sagittal.core.signals.rest import RestParams

RATE = 100.0


def sensor(gyr: Floats, acc: Floats | None = None) -> SensorSignals:
    n = len(gyr)
    force = np.tile([0.0, 9.81, 0.0], (n, 1)) if acc is None else acc
    return SensorSignals("s", force, gyr, None, np.ones(n, bool), np.zeros(n, bool))


def take(*sensors: SensorSignals) -> UniformRecording:
    names = ("foot_l", "foot_r", "shank_l")
    n = len(sensors[0].acc)
    mapping = dict(zip(names, sensors, strict=False))
    return UniformRecording(np.arange(n) / RATE, RATE, mapping, Subject(), "walk", {})  # type: ignore[arg-type]


def wobble(degrees_per_s: float, n: int = 1000, seed: int = 0) -> Floats:
    """Rate whose norm averages to a value, about changing axes."""
    t = np.arange(n) / RATE
    phase = 4 * np.pi * t + seed
    x = np.column_stack((np.sin(phase), np.cos(phase), np.zeros(n)))
    return np.asarray(np.radians(degrees_per_s) * x)


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1))
def test_vertical_frame_is_a_rotation_that_lays_up_on_y(v: tuple[float, float, float]) -> None:
    up = np.array(v) / np.linalg.norm(v)
    R = vertical_frame(up)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R @ up, [0, 1, 0], atol=1e-12)


def test_sensor_x_along_the_vertical_works() -> None:
    np.testing.assert_allclose(vertical_frame(np.array([1.0, 0.0, 0.0])) @ [1.0, 0, 0], [0, 1, 0], atol=1e-12)


def test_standing_gives_up_bias_and_norm() -> None:
    bias = np.radians([1.0, -0.5, 0.2])
    result = measure_standing(sensor(np.tile(bias, (500, 1))), RATE, (1.0, 4.0), "foot_l")
    np.testing.assert_allclose(result.up, [0, 1, 0])
    np.testing.assert_allclose(result.gyro_bias, bias)
    assert result.rest_norm == pytest.approx(9.81)


@pytest.mark.parametrize("norm", [0.02, 1.0, 98.1])
def test_rest_that_cannot_be_gravity_is_a_unit_error(norm: float) -> None:
    acc = np.tile([0.0, norm, 0.0], (500, 1))
    with pytest.raises(SignalError) as caught:
        measure_standing(sensor(np.zeros((500, 3)), acc), RATE, (0.0, 5.0), "foot_l")
    assert caught.value.code == "unit_suspect"
    assert f"{norm:.2f}" in caught.value.message


def test_missing_rest_says_how_still_it_was() -> None:
    with pytest.raises(SignalError) as slow:
        find_rests(take(sensor(wobble(10.0))), RestParams())
    assert slow.value.code == "not_still"
    assert "10.0 °/s" in slow.value.message
    with pytest.raises(SignalError) as fast:
        find_rests(take(sensor(wobble(34.0))), RestParams())
    assert fast.value.code == "no_rest"
    assert "34 °/s" in fast.value.message


def test_a_standing_that_sways_is_not_still_and_one_that_turned_takes_the_longer_bias() -> None:
    lean = np.radians(6.0) * np.linspace(0.0, 1.0, 300)
    force = 9.81 * np.stack((np.sin(lean), np.cos(lean), np.zeros(300)), axis=1)
    with pytest.raises(SignalError) as caught:
        find_rests(take(sensor(np.zeros((300, 3)), force)), RestParams())
    assert caught.value.code == "not_still"
    gyr = np.zeros((1000, 3))
    gyr[800:, 1] = np.radians(2.5)
    rests = ((0.0, 6.0), (8.0, 10.0))
    recording = take(sensor(gyr))
    (turned,) = stand_all(recording, rests[1], rests, RestParams()).values()
    assert np.allclose(turned.gyro_bias, 0.0)
    (single,) = stand_all(recording, rests[1], rests[1:], RestParams()).values()
    assert single.gyro_bias[1] == pytest.approx(np.radians(2.5))


def test_rests_that_never_meet_are_no_rest() -> None:
    left, right = np.zeros((1000, 3)), np.zeros((1000, 3))
    left[480:], right[:520] = wobble(60.0, 520), wobble(60.0, 520)
    with pytest.raises(SignalError) as caught:
        find_rests(take(sensor(left), sensor(right)), RestParams())
    assert caught.value.code == "no_rest"
    assert "never all of them together" in caught.value.message


def test_a_rest_shorter_than_a_second_is_said_to_be_too_short() -> None:
    gyr = wobble(120.0)
    gyr[500:570] = 0.0
    with pytest.raises(SignalError) as caught:
        find_rests(take(sensor(gyr)), RestParams())
    assert caught.value.code == "rest_too_short"


@pytest.mark.parametrize(
    ("rests", "walks", "expected"),
    [
        (((0.0, 11.0), (22.0, 25.0)), [(11.3, 21.0)], (2.75, 10.75)),
        (((36.7, 38.7),), [(1.0, 34.0)], (36.95, 38.7)),
        (((0.0, 1.2), (20.0, 25.0)), [(2.0, 19.0)], (20.25, 25.0)),
        (((10.0, 14.0), (20.0, 25.0)), [(2.0, 9.0), (14.5, 19.0)], (10.0, 13.75)),
        (((0.0, 5.0),), [], (0.0, 4.75)),
        (((0.0, 3.0), (10.0, 15.0)), [(4.0, 6.0), (8.0, 9.0), (15.3, 38.0)], (10.0, 14.75)),
    ],
)
def test_the_rest_next_to_the_walk_is_chosen(
    rests: tuple[tuple[float, float], ...],
    walks: list[tuple[float, float]],
    expected: tuple[float, float],
) -> None:
    moving = np.zeros(4000, bool)
    for a, b in walks:
        moving[round(a * RATE) : round(b * RATE)] = True
    assert choose_rest(rests, moving, RATE) == pytest.approx(expected, abs=0.02)


def test_invalid_samples_do_not_enter_the_mean() -> None:
    gyr = np.zeros((500, 3))
    gyr[100:200] = 5.0
    x = sensor(gyr)
    valid = np.ones(500, bool)
    valid[100:200] = False
    result = measure_standing(replace(x, valid=valid), RATE, (0.0, 5.0), "foot_l")
    np.testing.assert_allclose(result.gyro_bias, 0.0)
