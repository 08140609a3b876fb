"""Paths and rest positions of the feet, precomputed so that a frame of the replay only needs a count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sagittal.core import rotation
from sagittal.core.frames import Bools, Floats
from sagittal.core.signals.rest import find_runs

PIECE_M = 0.05
"""Length of the segments of a trail: some 30 per stride, none while the foot is stationary."""

CLEAR_M = 0.003
"""Height of footprints and trails above the floor, so that neither is hidden."""

REST_MPS = 0.2
"""Speed below which the middle of the sole rests: it is far slower while flat, faster once the heel rises
(our choice, based on simulated walks).
"""

SAME_M = 0.04
"""A rest this close to the previous one is the same footprint."""

_REST_WINDOW_S = 0.1

Single = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class FootTrail:
    """Path of one foot over the whole trial.

    Parameters
    ----------
    t_s : (k,) s, increasing, end time of each piece. pieces : (k, 2, 3) m, start and end, world.
    """

    t_s: Floats
    pieces: Single


@dataclass(frozen=True, eq=False)
class FootPrints:
    """Footprints of one foot.

    Parameters
    ----------
    t_s : (c,) s, increasing, times of rest. position : (c, 3) m, middle of the sole on the floor, world. wxyz
        : (c, 4) rotated about the vertical only, x to the toes.
    """

    t_s: Floats
    position: Single
    wxyz: Single


def lay_trail(t_s: Floats, valid: Bools, path: Floats | Single) -> FootTrail:
    """Divide a path (n, 3) into line segments, with gaps where samples are invalid."""
    stride = np.linalg.norm(np.diff(path, axis=0), axis=1)
    gone = np.concatenate(([0.0], np.cumsum(np.where(valid[1:] & valid[:-1], stride, 0.0))))
    # the first and last sample of every valid run are kept, so that no segment crosses a gap
    edge = valid & ~(np.append(valid[1:], False) & np.append(False, valid[:-1]))
    indices = np.flatnonzero(valid & (edge | (np.diff(gone // PIECE_M, prepend=-1.0) > 0)))
    lost = np.cumsum(~valid)
    whole = lost[indices[1:]] == lost[indices[:-1]]
    points = path[indices].astype(np.float32)
    points[:, 2] = np.maximum(points[:, 2], CLEAR_M)
    return FootTrail(t_s[indices[1:]][whole], np.stack((points[:-1], points[1:]), axis=1)[whole])


def find_prints(t_s: Floats, valid: Bools, contact: Bools, path: Floats | Single, q: Floats) -> FootPrints:
    """Find one footprint for every rest of the foot on the floor, at its lowest speed.

    Each contact contains at least one rest; several are possible, since a step within it may have been
    missed.

    Parameters
    ----------
    contact : (n,) foot on the floor. path : (n, 3) of the sole, m. q : (n, 4) of the foot.
    """
    n = len(t_s)
    half = max(1, round(_REST_WINDOW_S / 2 * n / max(t_s[-1] - t_s[0], _REST_WINDOW_S)))
    lower, upper = np.maximum(np.arange(n) - half, 0), np.minimum(np.arange(n) + half, n - 1)
    way = np.linalg.norm(path[upper] - path[lower], axis=1)
    speed = way / np.maximum(t_s[upper] - t_s[lower], _REST_WINDOW_S / 2)
    down = contact & valid
    slow = down & (speed < REST_MPS)
    slow[_slowest(down, speed)] = True
    rests: list[int] = []
    for index in _slowest(slow, speed):
        if not rests or np.hypot(*(path[index] - path[rests[-1]])[:2]) > SAME_M:
            rests.append(index)
    position = path[rests].astype(np.float32)
    position[:, 2] = CLEAR_M
    return FootPrints(t_s[rests], position, rotation.about(2, rotation.yaw(q[rests])).astype(np.float32))


def _slowest(mask: Bools, speed: Floats) -> list[int]:
    """Index of the lowest speed in every run of a mask."""
    return [int(start + np.argmin(speed[start:end])) for start, end in find_runs(mask)]
