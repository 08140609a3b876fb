"""Orientation of single sensors live: a foot that was lost is known again where it rests."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from core.calibration.result import SegmentCalibration
from core.frames import GRAVITY, R_NEUTRAL, Bools, Floats
from core.fusion.live_attitude import AttitudeTracker
from core.fusion.live_rest import RESTED_S
from core.rotation import angle_between, from_matrix

RATE = 100.0
SWING = slice(100, 140)
"""A foot stands, pitches down by 1 rad and back again, and stands."""

RESTS = SWING.stop + round(RESTED_S * RATE) - 1
"""First sample at which the rest after it is looked at."""


def swing() -> tuple[Floats, Floats, Bools]:
    """Signals (n, 1, 3) of a foot, and where it stands (n, 1)."""
    n = 300
    t = (np.arange(n) - SWING.start + 0.5) / (SWING.stop - SWING.start)
    inside = (t > 0) & (t < 1)
    rate = np.where(inside, 2 * np.pi * np.cos(2 * np.pi * t) / 0.4, 0.0)
    angle = np.where(inside, np.sin(2 * np.pi * t), 0.0)
    gyr, acc = np.zeros((n, 1, 3)), np.zeros((n, 1, 3))
    gyr[:, 0, 2] = rate
    acc[:, 0, 0], acc[:, 0, 1] = GRAVITY * np.sin(angle), GRAVITY * np.cos(angle)
    return acc, gyr, ~inside[:, None]


def track(
    acc: Floats, gyr: Floats, valid: Bools, still: Bools, cuts: Sequence[int] = ()
) -> tuple[Floats, Bools]:
    mounted = SegmentCalibration(np.eye(3), np.zeros(3), GRAVITY, "declared", 1.0)
    tracker = AttitudeTracker([0], [mounted], RATE, feet=1)
    edges = [0, *cuts, len(acc)]
    found = [tracker.push(acc[a:b], gyr[a:b], valid[a:b], still[a:b]) for a, b in pairwise(edges)]
    q, known = (np.concatenate(x) for x in zip(*found, strict=True))
    return q[:, 0], known[:, 0]


def off_deg(q: Floats) -> Floats:
    return np.degrees(angle_between(q, np.broadcast_to(from_matrix(R_NEUTRAL), q.shape)))


def test_a_foot_that_was_lost_in_swing_is_unknown_until_it_rests() -> None:
    acc, gyr, still = swing()
    valid = np.ones(still.shape, np.bool_)
    valid[110:125] = False
    q, known = track(acc, gyr, valid, still)
    np.testing.assert_array_equal(np.flatnonzero(~known), np.arange(110, RESTS))
    assert off_deg(q)[RESTS:].max() == pytest.approx(0.0, abs=0.5)


def test_a_rest_that_contradicts_it_begins_it_anew_and_is_itself_not_known() -> None:
    """Nothing was said to be lost, and still the gyroscope did not see all of the movement."""
    acc, gyr, still = swing()
    gyr[110:115] = gyr[109]
    q, known = track(acc, gyr, np.ones(still.shape, np.bool_), still)
    assert off_deg(q)[RESTS - 1] > 5.0
    assert np.flatnonzero(~known).tolist() == [RESTS]
    assert off_deg(q)[RESTS:].max() == pytest.approx(0.0, abs=0.1)


def test_a_foot_that_never_rests_is_known_again_when_its_tilt_is_learnt() -> None:
    once = swing()
    acc, gyr = (np.concatenate((x,) * 5) for x in once[:2])
    valid = np.ones(acc.shape[:2], np.bool_)
    valid[110:125] = False
    _, known = track(acc, gyr, valid, np.zeros_like(valid))
    # 1 / kp = 10 s after the loss
    np.testing.assert_array_equal(np.flatnonzero(~known), np.arange(110, 1125))


def test_any_division_into_blocks_gives_the_same_bits() -> None:
    acc, gyr, still = swing()
    gyr[120:124] = gyr[119]
    valid = np.ones(still.shape, np.bool_)
    valid[105:112] = False
    whole = track(acc, gyr, valid, still)
    parts = track(acc, gyr, valid, still, (3, 107, 110, 145, RESTS, RESTS + 1, 222))
    for a, b in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(a, b)
