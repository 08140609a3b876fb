"""Filter derivatives against finite differences of its loops."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core.frames import Floats
from sagittal.core.fusion.self_calibrating import SelfCalibratingFilter
from sagittal.core.fusion.self_calibrating import layout as at
from sagittal.core.fusion.self_calibrating.covariance import write_transition
from sagittal.core.fusion.self_calibrating.kernel import add_sample
from sagittal.core.fusion.self_calibrating.motion import tilt
from sagittal.core.rotation import conjugate, log, multiply
from tests.core.fusion.self_calibrating.moving import MovingSensor, move_sensor

pytestmark = pytest.mark.slow  # compiles for half a minute what the product does not run

SAMPLES = 10
DT = 0.01
JUDGED = np.array([0.0, 0.0, 0.7])
"""Shaken with 0.7 g²."""


@cache
def moved() -> MovingSensor:
    return move_sensor(12.0, seed=3)


@cache
def begun() -> tuple[Floats, slice]:
    """A nominal state in mid-motion, and the samples of the interval that follows."""
    sensor = moved()
    run = SelfCalibratingFilter(sensor.rate_hz, magnetometer=True)
    run.advance(*(v[:1000, None] for v in (sensor.gyr, sensor.acc, sensor.mag)))
    return run._x[0].copy(), slice(1000, 1000 + SAMPLES)


def propagate(x: Floats, error: Floats) -> tuple[Floats, Floats]:
    """State and sums at the end of an interval that began with these errors (33,) put into x."""
    _, part = begun()
    sensor = moved()
    x = x.copy()
    tilt(x[0:4], error[0], error[1], error[2])
    x[at.BIAS + at.SHIFT : at.WITH_MAG + at.SHIFT] += error[at.BIAS :]
    sums, counters = np.zeros(at.SUMS), np.zeros(at.COUNTERS, np.int64)
    ring, work = np.zeros((at.RING, at.RING_WIDTH)), np.empty((8, 4))
    for i in range(part.start, part.stop):
        signals = sensor.gyr[i], sensor.acc[i], sensor.mag[i]
        add_sample(x, sums, counters, ring, *signals, JUDGED, False, DT, work)
        counters[at.C_SEEN] += 1
        counters[at.C_RUN] += 1
    return x, sums


@pytest.mark.sweep
@pytest.mark.parametrize(
    ("first", "size", "rows", "share"),
    [
        (at.TILT, 2, 3, 2e-3),
        (at.ACC_BIAS, 3, 3, 1e-3),
        (at.GRAVITY, 1, 3, 1e-6),
        (at.ACC_DELAY, 1, 3, 1e-4),
        # what these do to the velocity by way of the heading is left out, the rest is a mean over the time
        (at.BIAS, 3, 1, 0.25),
        (at.MATRIX, 9, 1, 0.25),
        (at.SHAKEN, 3, 1, 0.25),
    ],
)
def test_errors_grow_over_an_interval_as_written(first: int, size: int, rows: int, share: float) -> None:
    """Orientation to a part in a thousand, velocity (the last rows of it) to a share."""
    x, _ = begun()
    _, sums = propagate(x, np.zeros(at.WITH_MAG))
    F = np.empty((6, at.WITH_MAG))
    write_transition(sums, SAMPLES, SAMPLES * DT, F)
    eye = np.eye(at.WITH_MAG)
    turned, pushed = np.empty((3, size)), np.empty((3, size))
    for k in range(size):
        step = 1e-6
        (up, _), (down, _) = (propagate(x, s * step * eye[first + k]) for s in (1.0, -1.0))
        initial = eye[first + k, :3]
        turned[:, k] = log(multiply(up[:4], conjugate(down[:4]))) / (2 * step) - initial
        pushed[:, k] = (up[7:10] - down[7:10]) / (2 * step)
    part = slice(first, first + size)
    assert F[:3, part] == pytest.approx(turned, abs=1e-3 * max(np.abs(turned).max(), 1e-3))
    last = slice(3 - rows, 3)
    assert F[3:][last, part] == pytest.approx(pushed[last], abs=share * max(np.abs(pushed[last]).max(), 1e-6))


@pytest.mark.sweep
def test_the_field_says_of_heading_iron_and_delay_what_is_written() -> None:
    x, _ = begun()
    _, sums = propagate(x, np.zeros(at.WITH_MAG))
    n, step, eye = SAMPLES, 1e-6, np.eye(at.WITH_MAG)

    def level_field(error: Floats) -> Floats:
        end, result = propagate(x, error)
        iron = result[at.S_MAG_R : at.S_MAG_R + 9].reshape(3, 3) @ end[at.IRON + 1 : at.IRON + 4]
        return np.asarray((result[at.S_MAG : at.S_MAG + 3] - iron) / n)

    def slope(column: int) -> Floats:
        up, down = (level_field(s * step * eye[column]) for s in (1.0, -1.0))
        return np.asarray((up - down) / (2 * step))

    # what the state explains grows, so that what is left of the field shrinks: the sign turns
    for i in range(3):
        written = sums[at.S_MAG_R : at.S_MAG_R + 9].reshape(3, 3)[:, i] / n
        assert -slope(at.IRON + i) == pytest.approx(written, abs=1e-3)
    late = sums[at.S_MAG_CROSS : at.S_MAG_CROSS + 3] / n
    assert -slope(at.MAG_DELAY) == pytest.approx(late, abs=0.1 * np.abs(late).max())
    north = sums[at.S_MAG + 1] / n
    assert slope(at.TILT + 2)[0] == pytest.approx(-north, rel=0.02)
