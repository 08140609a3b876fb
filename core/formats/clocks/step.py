"""The sampling interval of a column of stamps that may be damaged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Floats

Ints = NDArray[np.int64]

BURST: Final = 0.2
"""A step below this share of the usual one is no sampling interval: stamps were given on arrival [chosen: the
jitter of phones stays above it]."""
LARGE: Final = 4.0
"""Usual steps that the pause between two bursts exceeds."""
_WINDOWS: Final = (512, 128, 32, 8)
"""Stamps over which the interval is measured, the longest that is free of breaks often enough."""
_BROKEN: Final = 1.6
"""Of the usual step between stamps; more is a loss or a leap."""


@dataclass(frozen=True)
class Packets:
    """Rows in runs that share a stamp.

    Parameters
    ----------
    first : (m,) row at which each run begins. stamps : (m,) of each. step : of one row, in the unit of the
        stamps; None = unknown. usual : rows of a usual run, 1 = every row has its own stamp.
    """

    first: Ints
    stamps: Floats
    step: float | None
    usual: int

    def widths(self, rows: int) -> Ints:
        """Rows of each run."""
        return np.diff(self.first, append=rows)


def find_packets(x: Floats) -> Packets:
    """Runs of rows that share a stamp, or whose stamps were given in one burst, and the step of one row."""
    new = np.concatenate(([True], x[1:] != x[:-1]))
    if is_bursty(x):
        d = np.diff(x)
        is_boundary = np.concatenate(([True], (d > _burst_limit(d)) | (d < 0)))
        new &= is_boundary
    first = np.flatnonzero(new)
    widths = np.diff(first, append=len(x))
    usual = int(np.quantile(np.repeat(widths, widths), 0.4)) if len(first) > 2 else len(x)
    return Packets(first, x[first], _measure_step(x[first], widths, usual), usual)


def is_bursty(x: Floats) -> bool:
    """Whether rising stamps come in bursts: most of the time passes in few steps of about the same length."""
    every = np.diff(x)
    d = every[every > 0]
    if len(d) < 50:
        return False
    usual = float(np.median(d))
    large = d[d > LARGE * usual]
    if len(large) < max(8, len(d) // 600):
        return False
    if np.count_nonzero(every < -0.3 * np.median(large)) > 0.3 * len(large):
        return False  # stamps leap and come back
    most = 3.0 * float(np.median(large))  # beyond is a loss or a leap
    if large[large < most].sum() < 0.75 * d[d < most].sum():
        return False
    spread = np.subtract(*np.quantile(large, (0.75, 0.25)))
    return bool(spread < 0.5 * np.median(large))


def _burst_limit(d: Floats) -> float:
    rising = d[d > 0]
    return 0.3 * float(np.median(rising[rising > LARGE * np.median(rising)]))


def _measure_step(stamps: Floats, widths: Ints, usual: int) -> float | None:
    if len(stamps) < 3:
        return None
    each = np.diff(stamps)
    rising = each > 0
    if not rising.any():
        return None
    rough = float(np.median((each / widths[:-1])[rising]))
    typical = float(np.median(each[rising & (widths[:-1] >= usual)])) if (widths >= usual).any() else rough
    broken = np.concatenate(([0], np.cumsum((each <= 0) | (each > _BROKEN * typical))))
    for m in _WINDOWS:
        if m >= len(stamps) / 3:
            continue
        clean = np.flatnonzero(broken[m:] == broken[:-m])
        if len(clean) >= max(20, 0.15 * len(stamps)) or (m == _WINDOWS[-1] and len(clean)):
            offsets = np.concatenate(([0], np.cumsum(widths)))
            spans = (stamps[clean + m] - stamps[clean]) / (offsets[clean + m] - offsets[clean])
            middle = float(np.median(spans))
            near = np.abs(spans - middle) < 0.05 * abs(middle)
            return float(spans[near].mean())
    return rough
