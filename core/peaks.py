"""Peaks of a signal: what SciPy's `find_peaks` gives, without the 50 MB that its package brings along."""

from __future__ import annotations

from math import ceil

import numba
import numpy as np
from numpy.typing import NDArray

from core.frames import Bools, Floats


def _list_tops(x: Floats) -> NDArray[np.int64]:
    """Samples above both sides; of several that are equal the middle one."""
    if len(x) < 3:
        return np.zeros(0, np.int64)
    first = np.flatnonzero(np.concatenate(([True], x[1:] != x[:-1])))
    last = np.append(first[1:], len(x)) - 1
    level = x[first]
    is_top = (level[1:-1] > level[:-2]) & (level[1:-1] > level[2:])
    return ((first + last) // 2)[1:-1][is_top]


def _keep_apart(peaks: NDArray[np.int64], level: Floats, distance: int) -> Bools:
    """Which stay where the highest first takes all nearer than `distance` away."""
    stays = np.ones(len(peaks), np.bool_)
    first = np.searchsorted(peaks, peaks - distance, "right")
    end = np.searchsorted(peaks, peaks + distance, "left")
    for k in np.argsort(level)[::-1]:
        if stays[k]:
            stays[first[k] : end[k]] = False
            stays[k] = True
    return stays


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _write_prominences(x, peaks, out):  # type: ignore[no-untyped-def]
    """Write how far each peak is above the higher of the lowest points between it and what is above it."""
    for i in range(len(peaks)):
        top = x[peaks[i]]
        left = right = top
        k = peaks[i]
        while k >= 0 and x[k] <= top:
            left = min(left, x[k])
            k -= 1
        k = peaks[i]
        while k < len(x) and x[k] <= top:
            right = min(right, x[k])
            k += 1
        out[i] = top - max(left, right)


def find_peaks(
    x: Floats, height: float | None = None, distance: float | None = None, prominence: float | None = None
) -> NDArray[np.int64]:
    """Samples (k,) at which x (n,) is higher than on both sides, in order.

    Parameters
    ----------
    height : least value. distance : least samples between two, ≥ 1; of nearer ones the higher stays.
    prominence : least way down from a peak before something higher comes, on either side, of those that the
        other two leave.
    """
    x = np.ascontiguousarray(x, np.float64)
    peaks = _list_tops(x)
    if height is not None:
        peaks = peaks[x[peaks] >= height]
    if distance is not None:
        peaks = peaks[_keep_apart(peaks, x[peaks], ceil(distance))]
    if prominence is not None:
        above = np.empty(len(peaks))
        _write_prominences(x, peaks, above)
        peaks = peaks[above >= prominence]
    return peaks
