"""Where the sensor of a foot sits, from how the foot rolls over its ball.

L7S takes what a foot's sensor feels for the motion of the foot's middle. On a shoe the sensor sits further
in front: two feet with motion capture had it 4 and 5 cm ahead of the middle. With the heel up by 60° the
ankle then is 3 to 4 cm higher than L7S takes it for, and the knee bent by 10° more.

At push-off the heel rises while the ball stays on the floor, so there the sensor moves on a circle about the
ball, and its way tells how far it is from it (docs/science/l7s.md, "Where the sensor of a foot sits").
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache
from itertools import pairwise
from math import radians
from typing import Final

import numpy as np

from core.body.l7s.checks import BREAK_S, STRIDE_S
from core.body.l7s.filter import L7sInputs
from core.body.l7s.inputs import L7sTake
from core.body.l7s.legs import LEGS, LegModel
from core.frames import Bools, Floats
from core.rest import find_runs

ROLLS: Final = radians(20.0)
"""Rise of the heel up to which the ball is taken to stay. Later the foot rolls on over its toes: up to 30° a
foot of the simulation, whose forefoot is round, is found 0.5 cm further back, up to toe-off 2 cm."""

LEAST_ROLL: Final = radians(5.0)
"""A heel that rises by less tells nothing: the foot's speed at the end of its rest counts for as much."""

LEAST_STRIDES: Final = 3

TOGETHER: Final = 4096
"""Samples that are laid out for the strides in them at a time."""

ON_FOOT_M: Final = 0.12
"""No place on a foot is further from its middle."""


def find_sensor_offsets(inputs: L7sInputs | L7sTake, valid: Bools, model: LegModel, rate_hz: float) -> Floats:
    """Vector (2, 3) from each foot's sensor to the foot's middle, in Sy's axes of the foot, m.

    Zero, what the paper takes, where too few strides show it. Across the foot always zero: it rolls about
    that axis.

    Parameters
    ----------
    valid : (n, 3) sensor of BODIES there.
    """
    found = np.zeros((len(LEGS), 3))
    for leg in range(len(LEGS)):
        b = 1 + leg
        seen = []
        for swings in _take_together(_swings(inputs.step[:, leg], valid[:, b], rate_hz)):
            begin = swings[0][0]
            x = inputs.part(slice(begin, swings[-1][1]))
            R, acc = x.R[:, b], x.acc[:, b]
            rises = -np.arcsin(np.clip(R[:, 2, 2], -1.0, 1.0))
            parts = (slice(first - begin, last - begin) for first, last in swings)
            found_balls = (_find_ball(R[part], acc[part], rises[part], rate_hz) for part in parts)
            seen += [ball for ball in found_balls if ball is not None]
        if len(seen) < LEAST_STRIDES:
            continue
        forward_down = np.median(seen, axis=0) - [0.0, 0.5 * model.foot]
        if np.linalg.norm(forward_down) <= ON_FOOT_M:
            found[leg, ::2] = forward_down
    return found


def _swings(step: Bools, valid: Bools, rate_hz: float) -> list[tuple[int, int]]:
    """Half-open ranges from the last sample of a rest to the first of the next."""
    between = [(a[1] - 1, b[0] + 1) for a, b in pairwise(find_runs(step))]
    return [
        (first, last)
        for first, last in between
        if BREAK_S * rate_hz < last - first < STRIDE_S[1] * rate_hz and valid[first:last].all()
    ]


def _take_together(swings: Iterable[tuple[int, int]]) -> Iterator[list[tuple[int, int]]]:
    """Swings in order, as many at a time as lie within `TOGETHER` samples, or one."""
    together: list[tuple[int, int]] = []
    for swing in swings:
        if together and swing[1] - together[0][0] > TOGETHER:
            yield together
            together = []
        together.append(swing)
    if together:
        yield together


def _find_ball(R: Floats, acc: Floats, rises: Floats, rate_hz: float) -> Floats | None:
    """The ball (2,) from the sensor along the foot's x (down) and z (forward), m; None where the heel stays.

    From (R₀ − R) b = p − p₀ by least squares over the push-off, p from the velocity less its linear drift.

    Parameters
    ----------
    R : (m, 3, 3) and acc : (m, 3) of the foot from rest to rest. rises : (m,) how steep its sole is, rad.
    """
    rising = rises - rises[0]
    highest = int(np.argmax(rising))
    if rising[highest] < LEAST_ROLL:
        return None
    # from its fastest rise on the foot is on its way
    last = int(np.argmax(_differentiate(rising)[: highest + 1]))
    over = np.flatnonzero(rising[: highest + 1] > ROLLS)
    last = min(last, int(over[0])) if len(over) else last
    if rising[last] < LEAST_ROLL:
        return None
    v = _integrate(acc, 1.0 / rate_hz)
    v -= _ramp(len(v)) * v[-1]
    part = slice(0, last + 1)
    way = _integrate(v[part], 1.0 / rate_hz)
    turned = (R[0] - R[part])[:, :, ::2].reshape(-1, 2)
    return np.asarray(np.linalg.lstsq(turned, way.reshape(-1), rcond=None)[0])


def _differentiate(x: Floats) -> Floats:
    """Difference (m,) from sample to sample, the mean of both sides: `np.gradient` without its checks."""
    steps = np.diff(x)
    middle = (x[2:] - x[:-2]) / 2.0
    return np.concatenate((steps[:1], middle, steps[-1:]))


@lru_cache(maxsize=256)
def _ramp(length: int) -> Floats:
    """From 0 to 1 (length, 1); strides of a walk have few lengths."""
    ramp = np.linspace(0.0, 1.0, length)[:, None]
    ramp.setflags(write=False)
    return ramp


def _integrate(x: Floats, dt: float) -> Floats:
    """Integral (m, 3) of x (m, 3) from its first sample on, by trapezia."""
    steps = np.cumsum(dt * (x[1:] + x[:-1]) / 2.0, axis=0)
    return np.concatenate((np.zeros((1, x.shape[1])), steps))
