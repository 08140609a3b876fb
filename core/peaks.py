"""Peaks of a signal by height, distance and prominence: the rule of SciPy's `find_peaks`, compiled.

Its own copy, because the rest of `scipy.signal` costs every process two seconds and 50 MB.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from core.frames import Floats

Places = NDArray[np.int64]


def find_peaks(
    x: Floats, *, height: float | None = None, distance: float | None = None, prominence: float | None = None
) -> Places:
    """Samples (k,) at which x (n,) is higher than on both sides; of a level top its middle.

    Parameters
    ----------
    height : least value. distance : of two peaks nearer than so many samples the higher one stays.
        prominence : least height above the higher of the two lowest values that lie between the peak and a
        higher sample on either side. They are asked in this order.
    """
    x = np.ascontiguousarray(x, np.float64)
    peaks = np.asarray(_find_tops(x), np.int64)
    if height is not None:
        peaks = peaks[x[peaks] >= height]
    if distance is not None:
        peaks = peaks[_keep_apart(peaks, np.argsort(x[peaks]), math.ceil(distance))]
    if prominence is not None:
        peaks = peaks[_measure_prominences(x, peaks) >= prominence]
    return peaks


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _find_tops(x):  # type: ignore[no-untyped-def]
    """Samples that are higher than what is beside them, the middle of a level top; no end of the signal."""
    tops = np.empty(len(x) // 2, np.int64)
    count, i = 0, 1
    while i < len(x) - 1:
        after = i + 1
        if x[i - 1] < x[i]:
            while after < len(x) - 1 and x[after] == x[i]:
                after += 1
            if x[after] < x[i]:
                tops[count] = (i + after - 1) // 2
                count += 1
                i = after
                continue
        i += 1
    return tops[:count]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _keep_apart(peaks, by_height, distance):  # type: ignore[no-untyped-def]
    """Which peaks (k,) stay, from the highest down; by_height : (k,) their numbers, the lowest first."""
    stays = np.ones(len(peaks), np.bool_)
    for i in by_height[::-1]:
        if not stays[i]:
            continue
        k = i - 1
        while k >= 0 and peaks[i] - peaks[k] < distance:
            stays[k] = False
            k -= 1
        k = i + 1
        while k < len(peaks) and peaks[k] - peaks[i] < distance:
            stays[k] = False
            k += 1
    return stays


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _measure_prominences(x, peaks):  # type: ignore[no-untyped-def]
    """Height (k,) of every peak above the higher of the lowest values on its two sides."""
    out = np.empty(len(peaks))
    for j in range(len(peaks)):
        top = x[peaks[j]]
        before = after = top
        i = peaks[j]
        while i >= 0 and x[i] <= top:
            before = min(before, x[i])
            i -= 1
        i = peaks[j]
        while i < len(x) and x[i] <= top:
            after = min(after, x[i])
            i += 1
        out[j] = top - max(before, after)
    return out
