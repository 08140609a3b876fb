"""Position and heading of the walker, smoothed without delay and without lateral sway."""

from __future__ import annotations

from collections import deque
from math import hypot, pi
from typing import Final

from sagittal.server.viewer.motion import ROOT_WINDOW_S

GAP_S: Final = 1.0
"""After such a gap, or a step back in time, earlier samples are discarded."""

NEAR_M: Final = 0.3
"""Maximum distance of the smoothed position from the person: sway and push-off remain well below it; in a
U-turn the correction points the wrong way and would move the person into the camera.
"""

Sample = tuple[float, float, float, float]
"""Time in s, place in m, heading in rad."""


class LivePath:
    """Position and heading over the last two windows of about one stride.

    The mean over a window removes the sway but lags by half a window; the change from the previous window
    compensates this lag, so that steady walking is followed exactly.
    """

    def __init__(self) -> None:
        self._heading = 0.0
        self._clear()

    def push(self, t_s: float, x: float, y: float, heading: float) -> tuple[float, float, float]:
        """Add a position in m and a heading in rad and return both smoothed."""
        if self._late.samples and not 0.0 <= t_s - self._late.samples[-1][0] <= GAP_S:
            self._clear()
        # unwrapped, so that turning through ±π is continuous
        self._heading += (heading - self._heading + pi) % (2 * pi) - pi
        self._late.add((t_s, x, y, self._heading))
        while self._late.samples[0][0] <= t_s - ROOT_WINDOW_S:
            self._early.add(self._late.drop())
        while self._early.samples and self._early.samples[0][0] <= t_s - 2 * ROOT_WINDOW_S:
            self._early.drop()
        now, *position = self._late.mean()
        if self._early.samples and self._early.samples[0][0] <= t_s - 1.5 * ROOT_WINDOW_S:
            # both windows by their content: the older one may not be full yet
            earlier, *was = self._early.mean()
            share = (t_s - now) / (now - earlier)
            position = [a + (a - b) * share for a, b in zip(position, was, strict=True)]
        off_x, off_y = position[0] - x, position[1] - y
        share = min(1.0, NEAR_M / (hypot(off_x, off_y) or NEAR_M))
        return x + share * off_x, y + share * off_y, position[2]

    def _clear(self) -> None:
        self._late, self._early = _Window(), _Window()


class _Window:
    """Samples with incrementally updated sums."""

    def __init__(self) -> None:
        self.samples: deque[Sample] = deque()
        self._sums = [0.0, 0.0, 0.0, 0.0]

    def add(self, sample: Sample) -> None:
        self.samples.append(sample)
        self._sums = [a + b for a, b in zip(self._sums, sample, strict=True)]

    def drop(self) -> Sample:
        sample = self.samples.popleft()
        # restart an empty window, so that rounding errors do not accumulate
        self._sums = [a - b for a, b in zip(self._sums, sample, strict=True)] if self.samples else [0.0] * 4
        return sample

    def mean(self) -> list[float]:
        return [x / len(self.samples) for x in self._sums]
