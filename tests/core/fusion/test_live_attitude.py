"""Tilt of single sensors as samples come: the filter of a file, started standing, seen from the segment.

A foot that was lost is known again where it rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.frames import GRAVITY, R_NEUTRAL, Bools, Floats
from sagittal.core.fusion.attitude import AttitudeParams, AttitudeState, advance
from sagittal.core.fusion.live_attitude import AttitudeTracker
from sagittal.core.fusion.live_rest import RESTED_S
from sagittal.core.rotation import about, angle_between, conjugate, from_matrix, multiply, rotate, to_matrix
from sagittal.core.signals.calibrated import SegmentCalibration

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


def no_feet(samples: int) -> Bools:
    return np.zeros((samples, 0), np.bool_)


def track(sizes: int, params: AttitudeParams | None = None) -> Floats:
    acc, gyr, valid = measured()
    tracker = AttitudeTracker((2, 0), MOUNTS, RATE, params)
    parts = (slice(k, k + sizes) for k in range(0, N, sizes))
    return np.concatenate([tracker.push(acc[p], gyr[p], valid[p], no_feet(len(acc[p])))[0] for p in parts])


def test_it_is_the_filter_of_a_file_turned_into_the_segment() -> None:
    acc, gyr, valid = measured()
    result = track(N)
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
        assert np.abs(np.sum(result[:, place] * expected, axis=1)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("size", [1, 7, 100])
def test_blocks_do_not_matter(size: int) -> None:
    assert np.array_equal(track(size), track(N))


def test_who_stands_upright_stays_upright() -> None:
    mount = MOUNTS[1]
    q = from_matrix(mount.R_segment_sensor)
    force = rotate(conjugate(q), np.array([0.0, GRAVITY, 0.0]))
    tracker = AttitudeTracker((0,), (mount,), RATE)
    acc, gyr = np.tile(force, (50, 1, 1)), np.tile(BIAS, (50, 1, 1))
    frame = tracker.push(acc, gyr, np.ones((50, 1), np.bool_), no_feet(50))[0][:, 0]
    upright = from_matrix(R_NEUTRAL)
    assert np.abs(frame @ upright) == pytest.approx(1.0, abs=1e-12)


def test_its_gains_are_those_of_the_filter() -> None:
    assert not np.allclose(track(N, AttitudeParams(kp=1.0)), track(N), atol=1e-3)
    assert np.array_equal(track(N, AttitudeParams()), track(N))
    with pytest.raises(ParameterError) as caught:
        track(N, AttitudeParams(kp=-1.0))
    assert caught.value.code == "gain_out_of_range"


SWING = slice(100, 140)
"""Of a foot that stands, pitches down by 1 rad and back again, and stands."""

RESTS = SWING.stop + round(RESTED_S * RATE) - 1
"""First sample at which the rest after it is looked at."""


def swing() -> tuple[Floats, Floats, Bools]:
    """Signals (n, 1, 3) of a foot, and its still samples (n, 1)."""
    n = 300
    t = (np.arange(n) - SWING.start + 0.5) / (SWING.stop - SWING.start)
    inside = (t > 0) & (t < 1)
    rate = np.where(inside, 2 * np.pi * np.cos(2 * np.pi * t) / 0.4, 0.0)
    angle = np.where(inside, np.sin(2 * np.pi * t), 0.0)
    gyr, acc = np.zeros((n, 1, 3)), np.zeros((n, 1, 3))
    gyr[:, 0, 2] = rate
    acc[:, 0, 0], acc[:, 0, 1] = GRAVITY * np.sin(angle), GRAVITY * np.cos(angle)
    return acc, gyr, ~inside[:, None]


def track_foot(
    acc: Floats, gyr: Floats, valid: Bools, still: Bools, cuts: Sequence[int] = ()
) -> tuple[Floats, Bools]:
    straight = SegmentCalibration(np.eye(3), np.zeros(3), GRAVITY, "declared", 1.0)
    tracker = AttitudeTracker([0], [straight], RATE, feet=1)
    edges = [0, *cuts, len(acc)]
    frames = [tracker.push(acc[a:b], gyr[a:b], valid[a:b], still[a:b]) for a, b in pairwise(edges)]
    q, reference = (np.concatenate(x) for x in zip(*frames, strict=True))
    return q[:, 0], reference[:, 0]


def off_deg(q: Floats) -> Floats:
    return np.degrees(angle_between(q, np.broadcast_to(from_matrix(R_NEUTRAL), q.shape)))


def test_a_foot_that_was_lost_in_swing_is_unknown_until_it_rests() -> None:
    acc, gyr, still = swing()
    valid = np.ones(still.shape, np.bool_)
    valid[110:125] = False
    q, known_track = track_foot(acc, gyr, valid, still)
    np.testing.assert_array_equal(np.flatnonzero(~known_track), np.arange(110, RESTS))
    assert off_deg(q)[RESTS:].max() == pytest.approx(0.0, abs=0.5)


def test_a_rest_that_contradicts_it_begins_it_anew_and_is_itself_not_known() -> None:
    """No loss was reported, yet the gyroscope missed part of the movement."""
    acc, gyr, still = swing()
    gyr[110:115] = gyr[109]
    q, known_track = track_foot(acc, gyr, np.ones(still.shape, np.bool_), still)
    assert off_deg(q)[RESTS - 1] > 5.0
    assert np.flatnonzero(~known_track).tolist() == [RESTS]
    assert off_deg(q)[RESTS:].max() == pytest.approx(0.0, abs=0.1)


def test_a_foot_that_never_rests_is_known_again_when_its_tilt_is_learnt() -> None:
    single = swing()
    acc, gyr = (np.concatenate((x,) * 5) for x in single[:2])
    valid = np.ones(acc.shape[:2], np.bool_)
    valid[110:125] = False
    _, known_track = track_foot(acc, gyr, valid, np.zeros_like(valid))
    # 1 / kp = 10 s after the loss
    np.testing.assert_array_equal(np.flatnonzero(~known_track), np.arange(110, 1125))


def test_blocks_do_not_matter_to_a_foot_that_begins_anew() -> None:
    acc, gyr, still = swing()
    gyr[120:124] = gyr[119]
    valid = np.ones(still.shape, np.bool_)
    valid[105:112] = False
    whole = track_foot(acc, gyr, valid, still)
    parts = track_foot(acc, gyr, valid, still, (3, 107, 110, 145, RESTS, RESTS + 1, 222))
    for a, b in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(a, b)
