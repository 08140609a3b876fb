"""Peaks of a signal: equivalent to SciPy's `find_peaks`, without importing its package (50 MB)."""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Bools, Floats


def find_peaks(
    x: Floats, height: float | None = None, distance: float | None = None, prominence: float | None = None
) -> NDArray[np.int64]:
    """Samples (k,) at which x (n,) is higher than on both sides, in order.

    Parameters
    ----------
    height : minimum value. distance : minimum number of samples between two, ≥ 1; of closer ones the higher
        is kept. prominence : minimum descent from a peak before a higher value, on either side, applied after
        the other two.
    """
    if len(x) < 3:
        return np.zeros(0, np.int64)
    tops = _list_tops(x)
    stays = np.ones(len(tops), np.bool_) if height is None else x[tops] >= height
    if distance is not None:
        stays[stays] = _keep_apart(tops[stays], x[tops[stays]], ceil(distance))
    if prominence is not None:
        stays &= _measure_prominence(x, tops) >= prominence
    return tops[stays]


def _list_tops(x: Floats) -> NDArray[np.int64]:
    """Samples above both sides; of a plateau the middle one."""
    first = np.flatnonzero(np.concatenate(([True], x[1:] != x[:-1])))
    last = np.append(first[1:], len(x)) - 1
    level = x[first]
    is_top = (level[1:-1] > level[:-2]) & (level[1:-1] > level[2:])
    middle: NDArray[np.int64] = (first + last) // 2
    return middle[1:-1][is_top]


def _keep_apart(peaks: NDArray[np.int64], level: Floats, distance: int) -> Bools:
    """Mask of the peaks kept if the highest removes all closer than `distance` first."""
    stays = np.ones(len(peaks), np.bool_)
    first = np.searchsorted(peaks, peaks - distance, "right")
    end = np.searchsorted(peaks, peaks + distance, "left")
    for k in np.argsort(level)[::-1]:
        if stays[k]:
            stays[first[k] : end[k]] = False
            stays[k] = True
    return stays


def _measure_prominence(x: Floats, tops: NDArray[np.int64]) -> Floats:
    """Height of all peaks (k,) above the higher of the minima before a higher value on either side."""
    from sagittal.core.signals.kernel import find_lows

    level, higher = x[tops].astype(np.float64), np.empty((len(tops) + 1, 2))
    left, right = np.empty(len(tops)), np.empty(len(tops))
    valleys = np.minimum.reduceat(x, np.concatenate(([0], tops))).astype(np.float64)
    find_lows(float(x[0]), level, valleys[:-1].copy(), higher, left)
    find_lows(float(x[-1]), level[::-1].copy(), valleys[:0:-1].copy(), higher, right)
    prominence: Floats = level - np.maximum(left, right[::-1])
    return prominence


def compile_peak_kernel() -> None:
    """Compile the kernel or load it from the cache, so that the first recording is not delayed."""
    find_peaks(np.array([0.0, 1.0, 0.0]), height=0.0, distance=1.0, prominence=0.0)
