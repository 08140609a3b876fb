"""The compiled loops of `core.peaks`."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def find_maxima(x):  # type: ignore[no-untyped-def]
    """Places of the maxima of x (n,), of a flat one its middle."""
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
def drop_near(peaks, order, distance, keep):  # type: ignore[no-untyped-def]
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
def measure_prominence(x, peaks):  # type: ignore[no-untyped-def]
    """What each peak of x (n,) stands out by."""
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
