"""Samples at their own times → points of the uniform axis: the same rule for files and live recordings.

A point that coincides with a sample is a copy of it, any other is interpolated linearly; in a gap longer than
`max_gap_s` it is invalid and holds the last value (docs/science/timeline.md, "Rule"). The input are rows of
good samples by sensor, the first of them the last one before the current end of the axis. A file is one call
over all of its points.
"""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from sagittal.core.frames import Bools, Floats
from sagittal.core.timeline.params import TimelineParams

NEVER_S: Final = -1e12
"""Time of the sample before the first: further back than any hole that is filled."""

MEASURED: Final = 6
"""Channels of a sample that must all be there: acc and gyr."""


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def append_good(t_us, offset_us, samples, columns, slot, t, x, count):  # type: ignore[no-untyped-def]
    """Append the good samples (m, sensors, 9) of some columns to the rows from `slot` on."""
    for i in range(len(columns)):
        s, column = slot + i, columns[i]
        for k in range(len(t_us)):
            good = True
            for c in range(MEASURED):
                good = good and np.isfinite(samples[k, column, c])
            if good:
                t[s, count[s]] = (t_us[k] + offset_us) * 1e-6
                for c in range(MEASURED):
                    x[s, count[s], c] = samples[k, column, c]
                count[s] += 1


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def find_known_until(live, last_s, stream, step, max_gap, t, count):  # type: ignore[no-untyped-def]
    """Time up to which every sensor of the live streams can be resampled.

    This is its last good sample, or later once the gap is too long to be interpolated.
    """
    until = np.inf
    for s in range(len(stream)):
        if not live[stream[s]]:
            continue
        last, furthest = t[s, count[s] - 1], last_s[stream[s]]
        lost = furthest - last - step[s] > max_gap + 0.5 * step[s]
        until = min(until, furthest if lost else last)
    return until


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def lay_points(  # type: ignore[no-untyped-def]
    first, start, rate, slack, step, max_gap, t, x, count, out, valid, filled
):
    """Write the points from `first` on and drop the rows that later points do not need.

    Parameters
    ----------
    start, rate : time in s of point 0, points per second. slack : s, tolerance for a sample to coincide with
        a point. step : (n,) s between samples of each sensor. t : (n, rows) s, x : (n, rows, 3 g) good
        samples of each sensor, of which the first `count` (n,) are filled; all three are advanced in place.
    out : (g, T, n, 3), valid, filled : (T, n) written.
    """
    for s in range(len(count)):
        b, n = 0, count[s]
        for k in range(out.shape[1]):
            a = start + (first + k) / rate
            while b + 1 < n and t[s, b + 1] <= a + slack:
                b += 1
            # written as the advance is: one rounding decides whether a sample is passed and whether it is met
            on_sample = a - slack <= t[s, b] <= a + slack
            past = b == n - 1 and not on_sample
            share, is_between = 0.0, False
            if not on_sample and not past:
                hole = t[s, b + 1] - t[s, b]
                missing = hole - step[s]
                is_between = missing > 0.5 * step[s]
                past = is_between and missing > max_gap + 0.5 * step[s]
                share = 0.0 if past else (a - t[s, b]) / hole
            valid[k, s], filled[k, s] = not past, is_between and not past
            for c in range(x.shape[2]):
                value = x[s, b, c]
                if share != 0.0:
                    value += share * (x[s, b + 1, c] - value)
                out[c // 3, k, s, c % 3] = value
        for k in range(b, n):
            t[s, k - b] = t[s, k]
            for c in range(x.shape[2]):  # a row at once takes two seconds to compile
                x[s, k - b, c] = x[s, k, c]
        count[s] = n - b


def lay_signal(
    t_s: Floats,
    x: Floats,
    start_s: float,
    samples: int,
    own_rate: float,
    rate_hz: float,
    params: TimelineParams,
) -> tuple[Floats, Bools, Bools]:
    """Resample all signals of one sensor at once.

    Parameters
    ----------
    t_s : (m,) strictly increasing times of its good samples. x : (m, 3 g) their channels. own_rate : Hz of
        these. start_s, samples, rate_hz : of the axis.

    Returns
    -------
    Values (g, samples, 3), constant before the first sample; valid, filled (samples,).
    """
    t = np.concatenate(([NEVER_S], t_s))[None]
    rows = np.concatenate((x[:1], x)).astype(np.float64, copy=False)[None]
    out = np.empty((x.shape[1] // 3, samples, 1, 3))
    valid, filled = np.empty((samples, 1), np.bool_), np.empty((samples, 1), np.bool_)
    lay_points(
        0, float(start_s), float(rate_hz), params.on_grid / rate_hz, np.array([1.0 / own_rate]),
        params.max_gap_s, t, rows, np.array([t.shape[1]]), out, valid, filled,
    )  # fmt: skip
    return out[:, :, 0], valid[:, 0], filled[:, 0]
