"""Running mean, sd and fraction in the zone of strides, without storing them."""

from __future__ import annotations

from math import sqrt

from sagittal.core.feedback.cue import Summary


class RunningStatistics:
    """Accumulates strides one by one (Welford 1962: mean and squares in one pass)."""

    def __init__(self) -> None:
        self._n = 0
        self._mean = 0.0
        self._squares = 0.0
        self._inside = 0

    def add(self, value: float, inside: bool) -> None:
        """Add one stride."""
        self._n += 1
        self._inside += inside
        deviation = value - self._mean
        self._mean += deviation / self._n
        self._squares += deviation * (value - self._mean)

    @property
    def summary(self) -> Summary:
        """Summary so far; sd with n − 1."""
        if self._n == 0:
            return Summary()
        sd = None if self._n == 1 else sqrt(self._squares / (self._n - 1))
        return Summary(self._n, self._mean, sd, self._inside / self._n)
