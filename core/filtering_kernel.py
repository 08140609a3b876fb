"""The compiled loop of `core.filtering`."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def run_both_ways(x, section, rest, reach, out):  # type: ignore[no-untyped-def]
    """Write the rows of x (m, n) filtered both ways into out, their ends continued by `reach` samples."""
    m, n = x.shape
    b0, b1, b2, a1, a2 = section[0], section[1], section[2], section[3], section[4]
    y = np.empty((n + 2 * reach, m))
    now, next_ = np.empty(m), np.empty(m)
    for r in range(m):
        for k in range(reach):
            y[k, r] = 2.0 * x[r, 0] - x[r, reach - k]
            y[reach + n + k, r] = 2.0 * x[r, n - 1] - x[r, n - 2 - k]
        for k in range(n):
            y[reach + k, r] = x[r, k]
    for way in range(2):
        at, step = (0, 1) if way == 0 else (len(y) - 1, -1)
        for r in range(m):
            now[r], next_[r] = rest[0] * y[at, r], rest[1] * y[at, r]
        for _ in range(len(y)):
            # all rows at once: along one, a sample waits for the one before
            for r in range(m):
                put = y[at, r]
                got = b0 * put + now[r]
                now[r] = b1 * put - a1 * got + next_[r]
                next_[r] = b2 * put - a2 * got
                y[at, r] = got
            at += step
    for r in range(m):
        for k in range(n):
            out[r, k] = y[reach + k, r]
