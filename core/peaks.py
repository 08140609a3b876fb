"""Peaks of a signal: what SciPy's `find_peaks` gives, without the 50 MB that its package brings along."""

from __future__ import annotations

from math import ceil

import numba
import numpy as np
from numpy.typing import NDArray

from core.frames import Floats


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _write_maxima(x, found):  # type: ignore[no-untyped-def]
    """Write the samples of x that are above both sides, of a plateau the middle one; return how many."""
    count, k, last = 0, 1, len(x) - 1
    while k < last:
        if x[k - 1] < x[k]:
            ahead = k + 1
            while ahead < last and x[ahead] == x[k]:
                ahead += 1
            if x[ahead] < x[k]:
                found[count] = (k + ahead - 1) // 2
                count += 1
                k = ahead
        k += 1
    return count


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _keep_apart(peaks, by_height, distance, kept):  # type: ignore[no-untyped-def]
    """Clear in `kept` what is nearer than `distance` to a higher peak that stays."""
    for i in range(len(peaks) - 1, -1, -1):
        j = by_height[i]
        if not kept[j]:
            continue
        k = j - 1
        while k >= 0 and peaks[j] - peaks[k] < distance:
            kept[k] = False
            k -= 1
        k = j + 1
        while k < len(peaks) and peaks[k] - peaks[j] < distance:
            kept[k] = False
            k += 1


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
    found = np.empty(len(x) // 2 + 1, np.int64)
    peaks = found[: _write_maxima(x, found)].copy()
    if height is not None:
        peaks = peaks[x[peaks] >= height]
    if distance is not None:
        kept = np.ones(len(peaks), np.bool_)
        _keep_apart(peaks, np.argsort(x[peaks]), ceil(distance), kept)
        peaks = peaks[kept]
    if prominence is not None:
        above = np.empty(len(peaks))
        _write_prominences(x, peaks, above)
        peaks = peaks[above >= prominence]
    return peaks
