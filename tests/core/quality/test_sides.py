"""Which leg is the left one, from a pelvis that is pushed and turned towards the leg that swings."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.quality.sides import find_left_leg, smooth
from sagittal.core.rotation import about, conjugate, rotate

RATE, STRIDE_HZ, ONSET_S = 50.0, 0.9, 4.0

LATERAL_PHASE, TURNING_PHASE = 0.0, np.radians(130.0)
"""Of the push to the left and the turn to the left, as seen at two pelves."""


def walk(
    lateral_rad: float = LATERAL_PHASE,
    turning_rad: float = TURNING_PHASE,
    *,
    speed_mps: float = 1.0,
    rest_s: float = ONSET_S,
    seconds: float = 10.0,
    mount: Floats | None = None,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Pelvis and legs of a person starting along +x; phases are relative to the rate of leg 1 less leg 2."""
    t = np.arange(round((rest_s + seconds) * RATE)) / RATE - rest_s
    moving, cycle = (t >= 0.0).astype(float), 2.0 * np.pi * STRIDE_HZ * t
    first, second = (moving * (2.0 + sign * 1.5 * np.cos(cycle)) for sign in (1.0, -1.0))
    acc = np.zeros((len(t), 3))
    acc[:, 0] = speed_mps * ((t >= 0.0) & (t < 1.0))
    acc[:, 1] = moving * np.cos(cycle + lateral_rad)
    acc[:, 2] = GRAVITY
    gyr = np.zeros((len(t), 3))
    gyr[:, 2] = moving * 0.3 * np.cos(cycle + turning_rad)
    q = conjugate(about(0, 0.0) if mount is None else mount)
    return rotate(q, acc), rotate(q, gyr), first, second


def test_the_leg_that_the_pelvis_is_pushed_towards_is_the_left_one() -> None:
    acc, gyr, first, second = walk()
    assert find_left_leg(acc, gyr, first, second, RATE) == 1
    assert find_left_leg(acc, gyr, second, first, RATE) == 2
    acc, gyr, first, second = walk(LATERAL_PHASE + np.pi, TURNING_PHASE + np.pi)
    assert find_left_leg(acc, gyr, first, second, RATE) == 2


@pytest.mark.parametrize("mount", [about(0, np.pi / 2), about(1, 2.0), about(0, np.pi)])
def test_how_the_sensor_sits_does_not_matter(mount: Floats) -> None:
    assert find_left_leg(*walk(mount=mount), RATE) == 1


@pytest.mark.parametrize(
    ("lateral", "turning", "leg"),
    [
        (50.0, 50.0, 1),
        (-50.0, -50.0, 1),
        (70.0, 0.0, None),
        (0.0, 70.0, None),
        (180.0, 0.0, None),
        (0.0, 180.0, None),
        (130.0, 130.0, 2),
        (110.0, 180.0, None),
    ],
)
def test_a_side_is_said_only_if_push_and_turn_agree_within_sixty_degrees(
    lateral: float, turning: float, leg: int | None
) -> None:
    phases = LATERAL_PHASE + np.radians(lateral), TURNING_PHASE + np.radians(turning)
    assert find_left_leg(*walk(*phases), RATE) == leg


@pytest.mark.parametrize(("speed", "leg"), [(0.1, None), (0.5, 1), (2.5, 1), (4.0, None)])
def test_a_speed_that_nobody_starts_with_says_that_the_integration_failed(
    speed: float, leg: int | None
) -> None:
    assert find_left_leg(*walk(speed_mps=speed), RATE) == leg


def test_without_rest_before_it_or_too_short_a_walk_says_nothing() -> None:
    assert find_left_leg(*walk(rest_s=0.0), RATE) is None
    assert find_left_leg(*walk(seconds=2.5), RATE) is None
    acc, gyr, first, second = walk()
    shaken = acc + np.where(np.arange(len(acc)) % 2, 1.0, -1.0)[:, None]
    assert find_left_leg(shaken, gyr, first, second, RATE) is None
    assert find_left_leg(0.0 * acc, gyr, first, second, RATE) is None
    # nobody walks
    assert find_left_leg(acc, gyr, 0.0 * first, 0.0 * second, RATE) is None


def test_what_hardly_beats_with_the_stride_says_nothing() -> None:
    acc, gyr, first, second = walk()
    t = np.arange(len(acc)) / RATE
    acc[:, 1] += np.where(t >= ONSET_S, 30.0 * np.cos(2.0 * np.pi * 2.0 * STRIDE_HZ * t), 0.0)
    assert find_left_leg(acc, gyr, first, second, RATE) is None


def test_a_moving_mean_is_centred_and_at_least_one_sample_wide() -> None:
    x = np.zeros(9)
    x[4] = 3.0
    assert smooth(x, 3.0, 1.0).tolist() == pytest.approx([0, 0, 0, 1, 1, 1, 0, 0, 0])
    assert smooth(x, 0.0, 1.0).tolist() == x.tolist()
