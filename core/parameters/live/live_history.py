"""Ring buffers of the last seconds of all signals required to measure a stride."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Bools, Floats

KEPT_S: Final = 10.0
"""A stride, the pause it may hold (3 s), the stance after it and as much again."""

MOST: Final = 64
"""Samples that may be added at once."""


class SampleHistory:
    """Named columns of the samples 0, 1, 2 …, of which the last ones are stored.

    Parameters
    ----------
    floats, bools : name → shape of one sample.
    """

    def __init__(
        self, rate_hz: float, floats: Mapping[str, tuple[int, ...]], bools: Mapping[str, tuple[int, ...]]
    ) -> None:
        self._kept = round(KEPT_S * rate_hz) + MOST
        self._floats: dict[str, Floats] = {k: np.empty((2 * self._kept, *s)) for k, s in floats.items()}
        self._bools: dict[str, Bools] = {
            k: np.empty((2 * self._kept, *s), np.bool_) for k, s in bools.items()
        }
        self._first = self._rows = 0

    @property
    def length(self) -> int:
        """Number of samples so far."""
        return self._first + self._rows

    @property
    def reach(self) -> int:
        """Number of samples guaranteed to be stored, regardless of block sizes."""
        return self._kept - MOST

    def reaches(self, first: int, past: int) -> bool:
        """Whether samples first … past − 1 are guaranteed to be stored at `past`, regardless of block
        sizes.
        """
        return first >= 0 and past - first <= self.reach

    def append(self, columns: Mapping[str, NDArray[np.generic]]) -> None:
        """Add at most `MOST` samples of every column."""
        count = len(next(iter(columns.values())))
        if self._rows + count > 2 * self._kept:
            drop = self._rows - self._kept
            for a in (*self._floats.values(), *self._bools.values()):
                a[: self._kept] = a[drop : self._rows]
            self._first, self._rows = self._first + drop, self._kept
        for name, column in columns.items():
            store = self._floats if name in self._floats else self._bools
            store[name][self._rows : self._rows + count] = column
        self._rows += count

    def floats(self, name: str, first: int, past: int) -> Floats:
        """View (past − first, …) of a column, samples first … past − 1."""
        return self._floats[name][first - self._first : past - self._first]

    def bools(self, name: str, first: int, past: int) -> Bools:
        """View (past − first, …) of a column, samples first … past − 1."""
        return self._bools[name][first - self._first : past - self._first]
