"""Position of the sensor on a foot, estimated from the rolling of the foot over its ball.

L7S assumes that the foot sensor measures the motion of the middle of the foot. On a shoe the sensor is
further forward: for two feet with motion capture it was 4 and 5 cm in front of the middle. With the heel
raised by 60° the ankle is then 3 to 4 cm higher than in L7S, and the knee is flexed by 10° more.

At push-off the heel rises while the ball stays on the floor, so the sensor moves on a circle about the ball,
and its path determines the distance between them (docs/science/l7s.md, "Where the sensor of a foot sits").
"""

from __future__ import annotations

from itertools import pairwise
from math import asin, nan, radians
from typing import Final

import numba
import numpy as np
from numpy.typing import NDArray

from sagittal.core.body.l7s.checks import BREAK_S, STRIDE_S
from sagittal.core.body.l7s.filter import L7sInputs
from sagittal.core.body.l7s.inputs import L7sTake
from sagittal.core.body.l7s.legs import LEGS, LegModel
from sagittal.core.frames import Bools, Floats
from sagittal.core.signals.held_samples import cut_blocks, is_complete
from sagittal.core.signals.inner import inner_njit
from sagittal.core.signals.rest import find_runs

ROLLS: Final = radians(20.0)
"""Rise of the heel up to which the ball is taken to stay. Later the foot rolls on over its toes: up to 30° a
foot of the simulation, whose forefoot is round, is found 0.5 cm further back, up to toe-off 2 cm."""

LEAST_ROLL: Final = radians(5.0)
"""A heel that rises by less tells nothing: the foot's speed at the end of its rest counts for as much."""

LEAST_STRIDES: Final = 3

ON_FOOT_M: Final = 0.12
"""No place on a foot is further from its middle."""


def find_sensor_offsets(inputs: L7sInputs | L7sTake, valid: Bools, model: LegModel, rate_hz: float) -> Floats:
    """Vector (2, 3) from each foot's sensor to the middle of the foot, in Sy's axes of the foot, m.

    Zero, as assumed in the paper, with too few suitable strides. The medio-lateral component is always zero:
    the foot rolls about that axis.

    Parameters
    ----------
    valid : (n, 3) sensor of BODIES available.
    """
    offsets = np.zeros((len(LEGS), 3))
    for leg in range(len(LEGS)):
        b = 1 + leg
        swings = _swings(inputs.step[:, leg], valid[:, b], rate_hz)
        balls = np.empty((len(swings), 2))
        for part in cut_blocks(len(valid)):
            selected = slice(*np.searchsorted(swings[:, 0], (part.start, part.stop)))
            if selected.start < selected.stop:
                begin = swings[selected.start, 0]
                x = inputs.part(slice(begin, swings[selected.stop - 1, 1]))
                _find_balls(x.R[:, b], x.acc[:, b], swings[selected] - begin, 1.0 / rate_hz, balls[selected])
        complete = balls[is_complete(balls)]
        if len(complete) < LEAST_STRIDES:
            continue
        forward_down = np.median(complete, axis=0) - [0.0, 0.5 * model.foot]
        if np.linalg.norm(forward_down) <= ON_FOOT_M:
            offsets[leg, ::2] = forward_down
    return offsets


def _swings(step: Bools, valid: Bools, rate_hz: float) -> NDArray[np.int64]:
    """Half-open ranges (s, 2) from the last sample of a rest to the first of the next."""
    ranges = [(a[1] - 1, b[0] + 1) for a, b in pairwise(find_runs(step))]
    swings = [
        (first, last)
        for first, last in ranges
        if BREAK_S * rate_hz < last - first < STRIDE_S[1] * rate_hz and valid[first:last].all()
    ]
    return np.array(swings, np.int64).reshape(-1, 2)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _find_balls(R, acc, swings, dt, balls):  # type: ignore[no-untyped-def]
    """Write the position of the ball (s, 2) relative to the sensor along the foot's x (down) and z (forward),
    m, or NaN.

    From (R₀ − R) b = p − p₀ by least squares over the push-off, p from the velocity after removal of its
    linear drift.

    Parameters
    ----------
    R : (n, 3, 3) and acc : (n, 3) of a foot. swings : (s, 2) from rest to rest; NaN for swings without heel
        rise.
    """
    for s in range(len(swings)):
        first, last = swings[s]
        balls[s] = nan
        off = _find_push_off(R, first, last)
        if off < 0:
            continue
        drift = np.zeros(3)
        for k in range(first + 1, last):
            for c in range(3):
                drift[c] += 0.5 * dt * (acc[k - 1, c] + acc[k, c])
        v, way = np.zeros(3), np.zeros(3)
        xx, xz, zz, xp, zp = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(first + 1, off + 1):
            for c in range(3):
                previous = v[c] - (k - 1 - first) / (last - 1 - first) * drift[c]
                v[c] += 0.5 * dt * (acc[k - 1, c] + acc[k, c])
                now = v[c] - (k - first) / (last - 1 - first) * drift[c]
                way[c] += 0.5 * dt * (previous + now)
                x, z = R[first, c, 0] - R[k, c, 0], R[first, c, 2] - R[k, c, 2]
                xx, xz, zz, xp, zp = xx + x * x, xz + x * z, zz + z * z, xp + x * way[c], zp + z * way[c]
        free = xx * zz - xz * xz
        if free > 0.0:
            balls[s, 0], balls[s, 1] = (zz * xp - xz * zp) / free, (xx * zp - xz * xp) / free


@inner_njit()
def _find_push_off(R, first, last):  # type: ignore[no-untyped-def]
    """The last sample of a swing with the ball on the floor; −1 if the heel does not rise."""
    start = _find_rise(R, first)
    highest, top = first, 0.0
    for k in range(first, last):
        rise = _find_rise(R, k) - start
        if rise > top:
            highest, top = k, rise
    if top < LEAST_ROLL:
        return -1
    # from its fastest rise on the foot is on its way
    off, most = first, -np.inf
    for k in range(first, highest + 1):
        lower, upper = max(first, k - 1), min(last - 1, k + 1)
        speed = (_find_rise(R, upper) - _find_rise(R, lower)) / (upper - lower)
        if speed > most:
            off, most = k, speed
    for k in range(first, off):
        if _find_rise(R, k) - start > ROLLS:
            off = k
            break
    return off if _find_rise(R, off) - start >= LEAST_ROLL else -1


@inner_njit()
def _find_rise(R, k):  # type: ignore[no-untyped-def]
    """Inclination of the sole, rad."""
    return -asin(min(max(R[k, 2, 2], -1.0), 1.0))
