"""Smooth building blocks of all simulated paths: at least C³, so that accelerations have no steps.

A hard maximum on the knee causes acceleration spikes of 1,800 m/s², a blend weight that is not zero at
foot-off 290 m/s² (docs/science/simulation.md).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from sagittal.core.frames import Floats


def smoothstep(u: Floats) -> Floats:
    """C³ step from 0 (u ≤ 0) to 1 (u ≥ 1), of any shape (docs/science/simulation.md)."""
    u = np.clip(u, 0.0, 1.0)
    return u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)


def bump(u: Floats) -> Floats:
    """C³ bump on [0, 1] with height 1 at the middle, zero outside; u of any shape."""
    u = np.clip(u, 0.0, 1.0)
    return (4.0 * u * (1.0 - u)) ** 4


def phase_bump(phase: Floats, centre: float, half_width: float) -> Floats:
    """Bump in gait phase, periodic in 1: raised cosine to the fourth, height 1 at `centre`."""
    distance = np.abs((phase - centre + 0.5) % 1.0 - 0.5) / half_width
    return np.asarray(np.cos(0.5 * np.pi * np.clip(distance, 0.0, 1.0)) ** 4)


def smooth_max(x: Floats, floor: float | Floats, width: float) -> Floats:
    """Maximum of x and `floor` with a rounded corner: larger by width/2 where both are equal."""
    d = x - floor
    return np.asarray(floor + 0.5 * (d + np.sqrt(d**2 + width**2)))


def smooth(x: Floats, window: int) -> Floats:
    """Four running means of `window` samples along the first axis: piecewise linear knots become C³.

    Exactly constant wherever x is constant over four windows.
    """
    for _ in range(4):
        x = uniform_filter1d(x, window, axis=0, mode="nearest")
    return x


def join(u: Floats, start: Floats, end: Floats) -> Floats:
    """Correction over u ∈ [0, 1] that matches the value AND the rate of `start` at 0 and of `end` at 1.

    Without matching rates foot-off peaks were 13–16 g (docs/science/simulation.md, "Swing foot").

    Parameters
    ----------
    u : (n,) increasing, its first and last samples clipped to 0 and 1.
    start, end : (n,) or (n, k), desired corrections near the two ends.
    """
    ends = 0.35
    column = u.reshape(-1, *(1,) * (start.ndim - 1))
    s = smoothstep(column)
    if len(u) < 8:
        return np.asarray((1.0 - s) * start[0] + s * end[-1])
    # the outermost samples are clipped in u, so the rates are taken one sample inside
    rate_0 = (start[2] - start[1]) / (u[2] - u[1])
    rate_1 = (end[-2] - end[-3]) / (u[-2] - u[-3])
    leave = column * (1.0 - smoothstep(column / ends))
    arrive = (column - 1.0) * smoothstep((column - 1.0 + ends) / ends)
    return np.asarray((1.0 - s) * start[0] + s * end[-1] + leave * rate_0 + arrive * rate_1)
