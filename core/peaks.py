"""Peaks of a signal as scipy.signal finds them, to the bit, without importing it (core/filtering.py)."""

from __future__ import annotations

import math

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
    # readers of results, which search nothing, do without numba
    from core.peaks_kernel import drop_near, find_maxima, measure_prominence

    x = np.ascontiguousarray(x, np.float64)
    peaks = find_maxima(x)
    if height is not None:
        peaks = peaks[x[peaks] >= height]
    if distance > 1.0:
        keep = np.ones(len(peaks), np.bool_)
        drop_near(peaks, np.argsort(x[peaks]), math.ceil(distance), keep)
        peaks = peaks[keep]
    if prominence is not None:
        peaks = peaks[measure_prominence(x, peaks) >= prominence]
    return np.asarray(peaks)


def compile_peak_kernels() -> None:
    """Compile the search or load it."""
    find_peaks(np.zeros(8), height=1.0, distance=2.0, prominence=1.0)
