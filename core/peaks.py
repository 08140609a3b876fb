"""Peaks of a signal as scipy.signal finds them, to the bit, without importing it (core/filtering.py)."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from core.frames import Floats

Places = NDArray[np.int64]


def find_peaks(
    x: Floats, *, height: float | None = None, distance: float = 1.0, prominence: float | None = None
) -> Places:
    """Places of the local maxima of x (n,), ends excluded, of a flat one its middle.

    Parameters
    ----------
    height : lowest value of a peak. distance : samples between two peaks, at least; the lower one goes.
    prominence : what a peak stands out by, at least, above the higher of the two lowest values between it and
        the next higher ones.
    """
    x = np.ascontiguousarray(x, np.float64)
    peaks = _find_maxima(x)
    if height is not None:
        peaks = peaks[x[peaks] >= height]
    if distance > 1.0:
        keep = np.ones(len(peaks), np.bool_)
        _drop_near(peaks, np.argsort(x[peaks]), math.ceil(distance), keep)
        peaks = peaks[keep]
    if prominence is not None:
        peaks = peaks[_measure_prominence(x, peaks) >= prominence]
    return np.asarray(peaks)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _find_maxima(x):  # type: ignore[no-untyped-def]
    found = np.empty(len(x) // 2 + 1, np.int64)
    n, i, last = 0, 1, len(x) - 1
    while i < last:
        if x[i - 1] < x[i]:
            ahead = i + 1
            while ahead < last and x[ahead] == x[i]:
                ahead += 1
            if x[ahead] < x[i]:
                found[n] = (i + ahead - 1) // 2
                n += 1
                i = ahead
        i += 1
    return found[:n]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _drop_near(peaks, order, distance, keep):  # type: ignore[no-untyped-def]
    """Write False for the peaks that are nearer to a higher one; `order` (n,) sorts them by height."""
    for i in range(len(peaks) - 1, -1, -1):
        j = order[i]
        if keep[j]:
            k = j - 1
            while k >= 0 and peaks[j] - peaks[k] < distance:
                keep[k] = False
                k -= 1
            k = j + 1
            while k < len(peaks) and peaks[k] - peaks[j] < distance:
                keep[k] = False
                k += 1


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _measure_prominence(x, peaks):  # type: ignore[no-untyped-def]
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


def compile_peak_kernels() -> None:
    """Compile the search or load it."""
    find_peaks(np.zeros(8), height=1.0, distance=2.0, prominence=1.0)
