"""What a lost sensor is taken to measure until it comes back.

Holding its last values on would turn it round and round, and the joints its neighbours with it. It goes on as
it last did for a moment. Then the end of a limb is taken as fixed to what it hangs on, and a link between two
joints, which hold both its ends, as upright, at an even speed and turning as the trunk does. The filter's
noise for lost samples is wide (docs/science/erkf.md, "Lost samples"), so this decides little but what no
joint tells: the heading with which the sensor comes back, when the person has turned meanwhile. Simulated, 8
s with half a turn in them: a lost foot is 9 mm off its place, a thigh 3, a shank 8; with no turning assumed
161, 56, 8.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from core.body.tree import ImuTree
from core.frames import GRAVITY, Bools, Floats
from core.rotation import conjugate, multiply, rotate

HOLD_S: Final = 0.3
"""So long a sensor goes on as it last did: a gap of 0.3 s in mid-swing costs 1.4° at the ankle."""

POSTURE_S: Final = 1.0
"""About a stride: the mean specific force over it is gravity in the mean posture."""


def bridged(tree: ImuTree, acc: Floats, gyr: Floats, valid: Bools, rate_hz: float) -> tuple[Floats, Floats]:
    """Signals (T, n, 3) with every lost sample filled; causal but for a sensor's first samples.

    Parameters
    ----------
    acc, gyr : (T, n, 3), of any value where not valid. valid : (T, n), some of every sensor's.
    """
    acc, gyr = acc.copy(), gyr.copy()
    for i in range(len(tree.imus)):
        last = np.maximum.accumulate(np.where(valid[:, i], np.arange(len(valid)), -1))
        last[last < 0] = int(np.argmax(valid[:, i]))
        acc[:, i], gyr[:, i] = acc[last, i], gyr[last, i]
    held_acc, held_gyr = acc.copy(), gyr.copy()
    for i in range(len(tree.imus)):
        for start, stop in _gaps(valid[:, i]):
            begin = start + round(HOLD_S * rate_hz)
            if start == 0 or begin >= stop:
                continue
            up = _up(held_acc[:, i], start, start + 1, rate_hz)[0]
            acc[begin:stop, i], gyr[begin:stop, i] = GRAVITY * up, 0.0
            for j in guides(tree, i):
                turn = np.sum(held_gyr[begin:stop, j] * _up(held_acc[:, j], begin, stop, rate_hz), axis=1)
                there = valid[begin:stop, j]
                gyr[begin:stop, i][there] = turn[there, None] * up
            above = carrier(tree, i)
            if above is not None:
                k = begin + np.flatnonzero(valid[begin:stop, above])
                # in neutral standing the axes of all segments are parallel
                along = multiply(conjugate(tree.q_mount[i]), tree.q_mount[above])
                acc[k, i] = rotate(along, held_acc[k, above])
                gyr[k, i] = rotate(along, held_gyr[k, above])
    return acc, gyr


def _up(acc: Floats, start: int, stop: int, rate_hz: float) -> Floats:
    """Upward axis (m, 3) of one sensor in its mean posture over the time before samples start … stop − 1."""
    total = np.concatenate((np.zeros((1, 3)), np.cumsum(acc[:stop], axis=0)))
    k = np.arange(start, stop)
    mean = total[k] - total[np.maximum(0, k - round(POSTURE_S * rate_hz))]
    return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))


def _gaps(valid: Bools) -> list[tuple[int, int]]:
    """Runs start … stop − 1 of lost samples."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], ~valid, [False]))))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def guides(tree: ImuTree, i: int) -> list[int]:
    """Sensors that turn as one does on the whole, the best last: what it hangs on up to the trunk.

    The nearer to the trunk, the less it tilts, and the better its rate about its mean vertical is the
    person's turn. What hangs on a trunk guides it in its turn.
    """
    found: list[int] = []
    at = i
    while above := [j.proximal for j in tree.joints if j.distal == at]:
        at = above[0]
        found.append(at)
    return found or [j.distal for j in tree.joints if j.proximal == i]


def carrier(tree: ImuTree, i: int) -> int | None:
    """What the end of a limb hangs on; None for all others."""
    ends = [(j.proximal, j.distal) for j in tree.joints if i in (j.proximal, j.distal)]
    return ends[0][0] if len(ends) == 1 and ends[0][1] == i else None
