"""Frames of a sensor for tests of the monitor's parts."""

from __future__ import annotations

from math import ceil

import numpy as np

from sagittal.core.activity.frames import PER_MINUTE, Frames
from sagittal.core.frames import GRAVITY


def make_frames(count: int, first: int = 0, *, spread: float = 1.0, moved: float = 1.0) -> Frames:
    """So many frames of a sensor whose z points up: |acc| that is spread, minutes that moved."""
    minutes = ceil(count / PER_MINUTE)
    gravity = np.zeros((count, 3), np.float32)
    gravity[:, 2] = GRAVITY
    return Frames(
        first,
        np.ones(count, np.bool_),
        gravity,
        np.full(count, GRAVITY, np.float32),
        np.full(count, spread, np.float32),
        np.full((minutes, 3), moved, np.float32),
        np.full((minutes, 3), moved, np.float32),
    )
