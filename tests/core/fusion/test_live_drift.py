"""Headings that nothing holds stay together in a stream, and turns are no drift."""

from __future__ import annotations

import numpy as np

from sagittal.core.body.still import FOOT_STILL
from sagittal.core.frames import Floats
from sagittal.core.fusion.live_drift import HeadingHold
from sagittal.core.rotation import about, yaw

RATE = 100.0
MOVING = FOOT_STILL.gyr_limit


def in_blocks(n: int, seed: int) -> list[slice]:
    edges = np.unique(np.random.default_rng(seed).integers(0, n, 60))
    return [slice(int(a), int(b)) for a, b in zip([0, *edges], [*edges, n], strict=True) if b > a]


def drifting(n: int, seed: int) -> tuple[Floats, Floats]:
    """Pelvis and two feet that swing, turn about every 20 s and drift apart by 6° and −4° a minute."""
    t = np.arange(n) / RATE
    way = np.pi * np.floor((t + 2.0) / 20.0) * np.clip(((t + 2.0) % 20.0) / 2.0, 0.0, 1.0)
    rng = np.random.default_rng(seed)
    course = np.stack((
        way + np.radians(5.0) * np.sin(2 * np.pi * t),
        way + np.radians(8.0) + np.radians(4.0) * np.sin(2 * np.pi * t + 1.0) + np.radians(6.0) * t / 60.0,
        way - np.radians(8.0) + np.radians(4.0) * np.sin(2 * np.pi * t + 4.0) - np.radians(4.0) * t / 60.0,
    ), axis=1)  # fmt: skip
    return about(2, course + 0.01 * rng.standard_normal(course.shape)), np.full((n, 3, 3), 1.0)


def test_headings_are_held_over_five_minutes_and_turns_are_not_taken_for_drift() -> None:
    n = 30_000
    q, gyr = drifting(n, 0)
    valid = np.ones((n, 3), bool)
    valid[15_000:15_200, 1] = False
    held = q.copy()
    HeadingHold(("pelvis", "foot_l", "foot_r"), RATE, MOVING).push(held, gyr, valid)
    np.testing.assert_array_equal(held[:, 0], q[:, 0])

    def apart(x: Floats, i: int, position: slice) -> float:
        return float(np.degrees(np.angle(np.mean(np.exp(1j * (yaw(x[position, i]) - yaw(x[position, 0])))))))

    first, last = slice(200, 1600), slice(n - 1600, n - 200)
    for i, rate in ((1, 6.0), (2, -4.0)):
        assert abs(apart(q, i, last) - apart(q, i, first)) > 3.5 * abs(rate)
        assert abs(apart(held, i, last) - apart(held, i, first)) < 3.0
    second_duplicate = q.copy()
    hold = HeadingHold(("pelvis", "foot_l", "foot_r"), RATE, MOVING)
    for k in in_blocks(n, 5):
        hold.push(second_duplicate[k], gyr[k], valid[k])
    np.testing.assert_array_equal(second_duplicate, held)


def test_a_segment_alone_has_nothing_to_be_held_to() -> None:
    q, gyr = drifting(1000, 1)
    one = np.ascontiguousarray(q[:, 1:2])
    HeadingHold(("foot_l",), RATE, MOVING).push(one, gyr[:, :1], np.ones((1000, 1), bool))
    np.testing.assert_array_equal(one[:, 0], q[:, 1])
