"""Where a person is and where they go, smoothed without delay and without their sway."""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np

from core.frames import Floats
from server.viewer.motion import ROOT_WINDOW_S

GAP_S: Final = 1.0
"""After such a gap, or a step back in time, what was before says nothing about now."""


class LivePath:
    """Position and heading over the last two windows of about a stride.

    The mean over a window hides the sway but is half a window late; what it moved since the window before is
    how much it lacks, so that a steady walk is followed exactly.
    """

    def __init__(self) -> None:
        self._seen: deque[tuple[float, float, float, float]] = deque()
        self._heading = 0.0

    def push(self, t_s: float, place: Floats, heading: float) -> tuple[Floats, float]:
        """Take in a place (2,) in m and a heading in rad and return both smoothed."""
        if self._seen and not 0.0 <= t_s - self._seen[-1][0] <= GAP_S:
            self._seen.clear()
        # unwrapped, so that a turn through ±π is a turn like any other
        self._heading += (heading - self._heading + np.pi) % (2 * np.pi) - np.pi
        self._seen.append((t_s, float(place[0]), float(place[1]), self._heading))
        while self._seen[0][0] <= t_s - 2 * ROOT_WINDOW_S:
            self._seen.popleft()
        rows = np.array(self._seen)
        late = rows[:, 0] > t_s - ROOT_WINDOW_S
        now = rows[late, 1:].mean(axis=0)
        if rows[0, 0] <= t_s - 1.5 * ROOT_WINDOW_S:
            # both windows by what is in them: the older one may not be full yet
            way = now - rows[~late, 1:].mean(axis=0)
            apart = rows[late, 0].mean() - rows[~late, 0].mean()
            now += way / apart * (t_s - rows[late, 0].mean())
        return now[:2], float(now[2])
