"""A gain at the motion of a sample, compiled; defined in gains.py, which does not need numba."""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from sagittal.core.fusion.algorithms.gains import FUZZY_FALLS

POINTS: Final = 201
"""Of the centroid."""


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def is_moving(row):  # type: ignore[no-untyped-def]
    """Whether the gain of a `row` (42,) can differ from its first value."""
    return row[9] != 0.0 or min(row[3], row[4], row[5]) < np.inf


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def choose_level(rows, i, acc, mag, gyr):  # type: ignore[no-untyped-def]
    """Value of gain i of `rows` (g, 42) at deviations of accelerometer and magnetometer and a rate, rad/s."""
    if rows[i, 9] != 0.0:
        return infer_gain(rows[i], acc, mag, gyr)
    if acc < rows[i, 3] and mag < rows[i, 4] and gyr < rows[i, 5]:
        return rows[i, 0]
    if acc < rows[i, 6] and mag < rows[i, 7] and gyr < rows[i, 8]:
        return rows[i, 1]
    return rows[i, 2]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _rise(x, a, b):  # type: ignore[no-untyped-def]
    """Spline from 0 at a to 1 at b."""
    if x >= b:
        return 1.0
    if x <= a:
        return 0.0
    share = (x - a) / (b - a)
    return 2.0 * share * share if share < 0.5 else 1.0 - 2.0 * (1.0 - share) ** 2


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _memberships(x, row, offset):  # type: ignore[no-untyped-def]
    """Low, middle and high memberships of x with the corners at row[offset : at + 8]."""
    low = 1.0 - _rise(x, row[offset], row[offset + 1])
    middle = min(_rise(x, row[offset + 2], row[offset + 3]), 1.0 - _rise(x, row[offset + 4], row[offset + 5]))
    return low, middle, _rise(x, row[offset + 6], row[offset + 7])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def infer_gain(row, acc, mag, gyr):  # type: ignore[no-untyped-def]
    """Minimum for and, maximum for or, truncated sets, their maximum, its centroid on 201 points."""
    low, middle, high = 1.0, 0.0, 0.0
    for i in range(3):
        offset = 10 + 8 * i
        if not np.isnan(row[offset]):
            x = acc if i == 0 else mag if i == 1 else gyr
            is_low, is_middle, is_high = _memberships(x, row, offset)
            low, middle, high = min(low, is_low), max(middle, is_middle), max(high, is_high)
    middle = min(middle, 1.0 - high)
    if low == 0.0 and middle == 0.0 and high == 0.0:
        # exactly where two sets meet at zero
        middle = 1.0
    if row[9] == FUZZY_FALLS:
        low, high = high, low
    # now how far the gain is low, middle and high
    begin, end = min(row[34], 0.0), max(row[41], row[39])
    weight, moment = 0.0, 0.0
    for k in range(POINTS):
        x = begin + (end - begin) * k / (POINTS - 1)
        is_low, is_middle, is_high = _memberships(x, row, 34)
        share = max(min(low, is_low), min(middle, is_middle), min(high, is_high))
        weight += share
        moment += share * x
    return moment / weight if weight > 0.0 else 0.0
