"""Still periods of a foot, and the quietest moment of a stance without one."""

from __future__ import annotations

import numpy as np

from sagittal.core.body.still import FOOT_STILL, contact_samples, still_samples
from sagittal.core.frames import GRAVITY, Bools, Floats
from sagittal.core.signals.rest import find_runs

RATE = 100.0


def walk(quietest_rad_s: float, strides: int = 6, stride_s: float = 1.0) -> tuple[Floats, Floats, Bools]:
    """A foot that swings at 15 rad/s and slows to `quietest_rad_s` in the middle of each stance."""
    n = round(strides * stride_s * RATE)
    phase = np.arange(n) / RATE / stride_s
    rate = quietest_rad_s + 14.0 * np.sin(np.pi * phase) ** 4
    acc = np.tile([0.0, 0.0, GRAVITY], (n, 1))
    acc[:, 0] = 8.0 * np.sin(np.pi * phase) ** 4
    return acc, np.stack((0.0 * rate, rate, 0.0 * rate), axis=1), np.ones(n, np.bool_)


def middles(mask: Bools) -> Floats:
    return np.array([(a + b - 1) / 2 / RATE for a, b in find_runs(mask)])


def test_a_foot_that_stops_is_still_and_nothing_else_is_taken() -> None:
    take = walk(0.1)
    contact, rolling = contact_samples(*take, RATE)
    np.testing.assert_array_equal(contact, still_samples(*take, RATE, FOOT_STILL))
    assert contact.any()
    assert not rolling.any()


def test_a_foot_that_never_stops_has_one_moment_in_each_stance() -> None:
    take = walk(1.0)
    assert not still_samples(*take, RATE, FOOT_STILL).any()
    contact, rolling = contact_samples(*take, RATE)
    np.testing.assert_allclose(rolling, np.where(contact, take[1][:, 1], 0.0))
    # the first and last stance have a swing on one side only
    np.testing.assert_allclose(middles(contact), [1.0, 2.0, 3.0, 4.0, 5.0], atol=0.02)
    assert all(b - a <= 0.07 * RATE for a, b in find_runs(contact))


def test_a_stance_that_is_still_keeps_its_own_samples() -> None:
    acc, gyr, valid = walk(1.0)
    gyr[280:320] *= 0.05
    contact, rolling = contact_samples(acc, gyr, valid, RATE)
    assert contact[290:310].all()
    assert not rolling[250:350].any()
    assert rolling[195:206].any()


def test_too_loud_a_stance_a_lost_one_and_a_foot_that_does_not_swing_have_none() -> None:
    assert not contact_samples(*walk(1.6), RATE)[0].any()
    acc, gyr, valid = walk(1.0)
    valid[270:330] = False
    assert not contact_samples(acc, gyr, valid, RATE)[0][270:330].any()
    idle = np.full((600, 3), 0.6)
    assert not contact_samples(acc * 0 + [0, 0, GRAVITY], idle, valid, RATE)[0].any()
