"""Tilt of single sensors as samples come: the filter of a file, started standing, seen from the segment."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from core.calibration.result import SegmentCalibration
from core.errors import ParameterError
from core.frames import GRAVITY, R_NEUTRAL, Bools, Floats
from core.fusion.attitude import AttitudeParams, AttitudeState, advance
from core.fusion.live_attitude import AttitudeTracker
from core.rotation import about, conjugate, from_matrix, multiply, rotate, to_matrix

RATE, N = 100.0, 300
BIAS = np.array([0.02, -0.01, 0.03])


def mounted(turn: Floats) -> SegmentCalibration:
    return SegmentCalibration(to_matrix(turn), BIAS, 1.01 * GRAVITY, "declared", 1.0)


MOUNTS = (mounted(about(1, 0.7)), mounted(multiply(about(0, 2.0), about(2, -0.4))))


@cache
def measured() -> tuple[Floats, Floats, Bools]:
    """Three sensors of which the third and the first are tracked; the first is lost for a while."""
    rng = np.random.default_rng(0)
    acc = np.array([0.0, GRAVITY, 0.0]) + rng.normal(0.0, 1.0, (N, 3, 3))
    gyr = rng.normal(0.0, 1.0, (N, 3, 3))
    valid = np.ones((N, 3), np.bool_)
    valid[120:150, 0] = False
    return acc, gyr, valid


def track(sizes: int, params: AttitudeParams | None = None) -> Floats:
    acc, gyr, valid = measured()
    tracker = AttitudeTracker((2, 0), MOUNTS, RATE, params)
    parts = (slice(k, k + sizes) for k in range(0, N, sizes))
    return np.concatenate([tracker.push(acc[p], gyr[p], valid[p]) for p in parts])


def test_it_is_the_filter_of_a_file_turned_into_the_segment() -> None:
    acc, gyr, valid = measured()
    found = track(N)
    for place, (sensor, mount) in enumerate(zip((2, 0), MOUNTS, strict=True)):
        turn = from_matrix(mount.R_segment_sensor)
        state = AttitudeState(from_matrix(R_NEUTRAL @ mount.R_segment_sensor), np.zeros(3))
        q, _ = advance(
            state,
            gyr[:, sensor] - BIAS,
            acc[:, sensor],
            valid[:, sensor],
            RATE,
            mount.rest_norm,
            AttitudeParams(),
        )
        expected = multiply(q, conjugate(turn))
        assert np.abs(np.sum(found[:, place] * expected, axis=1)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("size", [1, 7, 100])
def test_blocks_do_not_matter(size: int) -> None:
    assert np.array_equal(track(size), track(N))


def test_who_stands_upright_stays_upright() -> None:
    mount = MOUNTS[1]
    q = from_matrix(mount.R_segment_sensor)
    force = rotate(conjugate(q), np.array([0.0, GRAVITY, 0.0]))
    tracker = AttitudeTracker((0,), (mount,), RATE)
    acc, gyr = np.tile(force, (50, 1, 1)), np.tile(BIAS, (50, 1, 1))
    found = tracker.push(acc, gyr, np.ones((50, 1), np.bool_))[:, 0]
    upright = from_matrix(R_NEUTRAL)
    assert np.abs(found @ upright) == pytest.approx(1.0, abs=1e-12)


def test_its_gains_are_those_of_the_filter() -> None:
    assert not np.allclose(track(N, AttitudeParams(kp=1.0)), track(N), atol=1e-3)
    assert np.array_equal(track(N, AttitudeParams()), track(N))
    with pytest.raises(ParameterError) as caught:
        track(N, AttitudeParams(kp=-1.0))
    assert caught.value.code == "gain_out_of_range"
