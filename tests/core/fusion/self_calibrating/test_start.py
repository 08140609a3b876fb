"""The first orientation of a sensor: level and to the north, at rest and in motion, and how sure it is."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.fusion.self_calibrating import layout as at
from sagittal.core.fusion.self_calibrating.params import (
    LEAST_FIELD,
    MAG_NOISE,
    REGION_ACROSS_SD,
    START_HEADING,
    START_MOVING,
    START_MOVING_S,
    START_S,
    START_TILT,
    SelfCalibratingParams,
    make_weights,
)
from sagittal.core.fusion.self_calibrating.start import is_known, start_from_first, take_start
from sagittal.core.rotation import about, conjugate, exp, multiply, rotate
from tests.core.fusion.self_calibrating.moving import NORTH

pytestmark = pytest.mark.slow  # the loops are compiled with the rest of the filter

RATE, DT = 100.0, 0.01
PARAMS = SelfCalibratingParams()
FIRST = multiply(about(0, 0.6), about(1, -0.4))
"""Sensor to world, not yet to the north."""


class Start:
    """The arrays of one sensor before its first sample."""

    def __init__(self, *, magnetometer: bool = True) -> None:
        size = at.WITH_MAG if magnetometer else at.WITHOUT_MAG
        self.x, self.P = np.zeros(at.STATE), np.zeros((size, size))
        self.x[0] = 1.0
        self.counters = np.zeros(at.COUNTERS, np.int64)

    def take(self, gyr: Floats, acc: Floats, mag: Floats) -> bool:
        return bool(take_start(self.x, self.P, make_weights(PARAMS), DT, self.counters, gyr, acc, mag))

    def find(self, gyr: Floats, acc: Floats, mag: Floats) -> None:
        start_from_first(self.x, self.P, make_weights(PARAMS), DT, self.counters, gyr, acc, mag)

    def turn_to_world(self, v: Floats) -> Floats:
        return np.asarray(rotate(self.x[:4], v))


def measured(n: int, rate: float = 0.0) -> tuple[Floats, Floats, Floats]:
    """Signals (n, 3) of a sensor that turns about the vertical, each of the end of its interval."""
    turned = exp(np.outer(np.arange(n) * rate * DT, [0.0, 0.0, 1.0]))
    q = multiply(turned, FIRST)
    up, field = (rotate(conjugate(q), v) for v in (np.array([0.0, 0.0, GRAVITY]), 40.0 * NORTH))
    return rotate(conjugate(q), np.array([0.0, 0.0, rate])), up, field


def level(result: Start, acc: Floats) -> Floats:
    return np.asarray(result.turn_to_world(acc / np.linalg.norm(acc)))


@pytest.mark.parametrize(
    ("v", "known"),
    [
        ([0.0, 0.0, 0.0], False),
        ([0.0, -1e-9, 0.0], True),
        ([np.nan, 1.0, 1.0], False),
        ([1.0, 1.0, np.inf], False),
    ],
)
def test_zeros_and_what_is_no_number_are_not_known(v: list[float], known: bool) -> None:
    assert bool(is_known(np.array(v))) is known


@pytest.mark.parametrize(("rate", "lasts_s"), [(0.0, START_S), (0.19, START_S), (0.3, START_MOVING_S)])
def test_it_is_over_sooner_at_rest_than_in_motion_and_level_and_to_the_north(
    rate: float, lasts_s: float
) -> None:
    gyr, acc, mag = measured(301, rate)
    start_state = Start()
    over = [start_state.take(*signals) for signals in zip(gyr, acc, mag, strict=True)]
    assert over.index(True) + 1 == round(lasts_s * RATE)
    start_state = Start()
    for i in range(round(lasts_s * RATE)):
        start_state.take(gyr[i], acc[i], mag[i])
    assert level(start_state, acc[i]) == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert start_state.turn_to_world(mag[i]) / 40.0 == pytest.approx(NORTH, abs=1e-8)
    assert start_state.x[at.NORM] == pytest.approx(40.0)
    assert start_state.x[at.NORTH : at.NORTH + 3] == pytest.approx(NORTH, abs=1e-8)
    assert start_state.counters[at.C_START] == -1


def test_a_push_is_motion_as_a_turn_is() -> None:
    gyr, acc, mag = measured(60)
    acc[20] += [0.6, 0.0, 0.0]
    start_state = Start()
    assert not any(start_state.take(*signals) for signals in zip(gyr, acc, mag, strict=True))
    assert start_state.x[at.MOVED] == 1.0


def test_how_sure_a_start_at_rest_is() -> None:
    start_state = Start()
    start_state.find(*measured(100))
    var = np.diag(start_state.P)
    noise = MAG_NOISE**2 / START_S
    assert var[at.TILT : at.TILT + 2] == pytest.approx(START_TILT**2)
    assert var[at.TILT + 2] == pytest.approx(noise / NORTH[1] ** 2)
    assert var[at.BIAS : at.BIAS + 3] == pytest.approx(PARAMS.gyro_bias_sd**2)
    assert var[at.MATRIX : at.MATRIX + 9] == pytest.approx(PARAMS.gyro_matrix_sd**2)
    region = np.array([REGION_ACROSS_SD**2, PARAMS.field_sd**2, PARAMS.field_sd**2])
    assert var[at.FIELD : at.FIELD + 3] == pytest.approx(region + LEAST_FIELD**2)
    assert var[at.REGION : at.REGION + 3] == pytest.approx(region + np.array([0.0, noise, noise]))
    # the field that was read is place and region together: what one has more the other has less
    assert np.diag(start_state.P[at.FIELD : at.FIELD + 3, at.REGION : at.REGION + 3]) == pytest.approx(
        -region
    )
    assert np.array_equal(start_state.P, start_state.P.T)
    assert np.linalg.eigvalsh(start_state.P).min() > -1e-15
    assert start_state.x[at.GRAVITY + at.SHIFT] == GRAVITY
    # iron is judged from the orientation in which the field was read
    assert start_state.x[at.START_R : at.START_R + 9].reshape(3, 3) @ start_state.x[
        at.START_R : at.START_R + 9
    ].reshape(3, 3).T == pytest.approx(np.eye(3), abs=1e-9)


def test_in_motion_all_is_four_times_less_sure_and_without_a_field_the_heading_is_a_definition() -> None:
    moving, still = Start(magnetometer=False), Start(magnetometer=False)
    still.find(*measured(400)[:2], np.zeros((0, 3)))
    moving.find(*measured(400, 0.5)[:2], np.zeros((0, 3)))
    for result, k in ((still, 1.0), (moving, START_MOVING**2)):
        var = np.diag(result.P)
        assert var[at.TILT] == pytest.approx(k * START_TILT**2)
        assert var[at.TILT + 2] == pytest.approx(k * START_HEADING**2)
        assert not result.x[at.NORTH : at.NORTH + 3].any()
    assert np.diag(moving.P)[at.SPEED] == pytest.approx(START_MOVING**2 * np.diag(still.P)[at.SPEED])


def test_of_a_whole_recording_it_is_seen_from_the_first_sample() -> None:
    gyr, acc, mag = measured(400, 0.5)
    start_state = Start()
    start_state.find(gyr, acc, mag)
    assert level(start_state, acc[0]) == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert start_state.turn_to_world(mag[0]) / 40.0 == pytest.approx(NORTH, abs=1e-8)
    assert (start_state.counters[at.C_SEEN], start_state.counters[at.C_START]) == (0, -1)


def test_lost_samples_are_passed_over_and_a_recording_may_be_shorter_than_a_start() -> None:
    gyr, acc, mag = measured(100)
    for x in (gyr, acc):
        x[:5] = 0.0
        x[7] = np.nan
    start_state = Start()
    start_state.find(gyr, acc, mag)
    assert level(start_state, acc[50]) == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    short = Start()
    short.find(*(x[20:30] for x in (gyr, acc, mag)))
    assert level(short, acc[20]) == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert np.diag(short.P)[at.TILT] == pytest.approx(START_TILT**2)
    assert short.counters[at.C_START] == -1
