"""Clocks and counters that start again at the end of their range."""

from __future__ import annotations

from typing import Final

import numpy as np

from sagittal.core.frames import Floats

_DAY: Final = 86_400.0
_CLOCKS: Final = (
    (_DAY, "midnight"),
    (_DAY / 2, "noon or midnight of a 12-hour clock"),
    (3600.0, "the full hour"),
    (60.0, "the full minute"),
    (2.0**24 / 32768, "24 bits at 32768 Hz"),
    (2.0**16 / 32768, "16 bits at 32768 Hz"),
    (2.0**32 / 32768, "32 bits at 32768 Hz"),
    (2.0**32 * 1e-6, "32 bits of microseconds"),
    (2.0**32 * 1e-9, "32 bits of nanoseconds"),
    (2.0**24 * 1e-6, "24 bits of microseconds"),
    (2.0**16 * 1e-3, "16 bits of milliseconds"),
    (2.0**16 * 1e-4, "16 bits of 0.1 ms"),
    (2.0**32 * 1e-4, "32 bits of 0.1 ms"),
    (2.0**32 * 1e-3, "32 bits of milliseconds"),
)
"""Ranges of clocks, s."""
_BITS: Final = (8, 10, 12, 16, 20, 24, 31, 32)
_LEAST_STEPS: Final = 40
"""Samples of a range at least: a shorter one cannot tell a wrap from packets out of order."""
_OUTLIERS: Final = 5
"""Rows of the median that takes out single wrong stamps."""
_MOST_LOST: Final = 0.3
"""Of a range: more cannot be lost at a wrap that is to be told from a restart."""
_FEW_STEPS: Final = 4.0
_CLOSE: Final = 0.02
"""Most wraps come within so many steps, or this share of the range, of its end."""


def unwrap(x: Floats, wrap: float) -> Floats:
    """Undo wraps of a known range: steps are taken modulo it, to the nearer side."""
    step = np.mod(np.diff(x) + wrap / 2, wrap) - wrap / 2
    return np.concatenate((x[:1], x[:1] + np.cumsum(step)))


def find_wrap(x: Floats, step: float, usual: int, tick: float, *, seconds: bool) -> tuple[float, str] | None:
    """The range after which stamps start again, and its name; None where nothing wraps.

    Parameters
    ----------
    x : (n,) stamps. step : of one row. usual : rows that share a stamp. tick : length of the smallest unit
        of the column as written, in the unit of x, 0 = unknown. seconds : x is in s, else it counts samples.
    """
    from scipy.ndimage import median_filter  # not in the web server

    if not (np.diff(x) < 0).any():
        return None
    x = np.asarray(median_filter(x, _OUTLIERS, mode="nearest"))
    d = np.diff(x)
    ranges = [(w, name) for w, name in _CLOCKS] if seconds else []
    units = {tick, step} if seconds else {1.0}
    ranges += [(2.0**k * unit, f"{k} bits") for unit in units if unit > 0 for k in _BITS]
    best: tuple[float, float, str] | None = None
    top, low = float(x.max()), float(x.min())
    for wrap, name in ranges:
        if low < 0 or top >= wrap * (1 + 1e-9) or wrap < _LEAST_STEPS * step or top < 0.75 * wrap:
            continue
        drops = np.flatnonzero(d < -0.6 * wrap)
        left_over = d[drops] + wrap
        if not len(drops) or (left_over > _MOST_LOST * wrap).any():
            continue
        if float(np.median(left_over)) > max(_FEW_STEPS * usual * step, _CLOSE * wrap):
            continue  # the clock ended somewhere else: it was started again
        # what is left of the steps down there, and how near the end of the range the stamps come
        left = float(np.median(np.abs(d[drops] + wrap - step))) + max(0.0, wrap - top - 2 * step)
        if best is None or left < best[0]:
            best = left, wrap, name
    return None if best is None else (best[1], best[2])
