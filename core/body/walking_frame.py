"""Accelerations in the walking frame: forward, left, up, independent of the walking direction."""

from __future__ import annotations

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.rotation import yaw

HEADING_S = 2.0
"""The heading is averaged over so long: the turning of the trunk within a stride is part of gait, not of the
way. Our choice: about two strides."""


def in_walking_frame(acceleration: Floats, q: Floats, rate_hz: float) -> Floats:
    """Rotate accelerations (n, 3) in W about the vertical, so that x is the segment's mean heading.

    Parameters
    ----------
    q : (n, 4) segment to W. Its forward axis gives the heading, averaged over `HEADING_S`.
    """
    n = len(q)
    if n == 0:
        return acceleration
    half = max(1, round(HEADING_S * rate_hz / 2))
    total = np.concatenate(([0.0], np.cumsum(np.unwrap(yaw(q)))))
    first, past = np.maximum(np.arange(n) - half, 0), np.minimum(np.arange(n) + half + 1, n)
    heading = (total[past] - total[first]) / (past - first)
    c, s = np.cos(heading), np.sin(heading)
    x, y, z = acceleration.T
    return np.stack((c * x + s * y, c * y - s * x, z), axis=1)
