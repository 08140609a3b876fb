"""The good samples of all worn sensors on their way to the axis, and the laying of them.

core/timeline.py `Place`, sample by sample: the same comparisons and the same sums in the same order, so that
the points are equal to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numba
import numpy as np
from numpy.typing import NDArray

from core.formats.live_clock import Micros
from core.frames import Bools, Floats
from core.timeline import TimelineParams

NEVER_S: Final = -1e12
"""Time of the sample before the first: further back than any hole that is filled."""

MEASURED: Final = 6
"""Channels of a sample that must all be there: acc and gyr."""

Ints = NDArray[np.int64]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _append(t_us, offset_us, samples, columns, slot, t, x, count):  # type: ignore[no-untyped-def]
    """Add the good samples (m, sensors, 9) of some columns to the rows from `slot` on."""
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
def _until(live, last_s, stream, step, max_gap, t, count):  # type: ignore[no-untyped-def]
    """Time up to which every sensor of the live streams can be laid.

    Up to its last good sample; beyond, once the hole is too long to be filled by any sample to come.
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
def _lay(  # type: ignore[no-untyped-def]
    first, start, rate, slack, step, max_gap, t, x, count, acc, gyr, valid, filled
):
    """Write the points from `first` on and drop the rows that no later point needs."""
    for s in range(len(count)):
        b, n = 0, count[s]
        for k in range(len(acc)):
            a = start + (first + k) / rate
            while b + 1 < n and t[s, b + 1] <= a + slack:
                b += 1
            on_sample = abs(a - t[s, b]) <= slack
            past = b == n - 1 and not on_sample
            share, between = 0.0, False
            if not on_sample and not past:
                hole = t[s, b + 1] - t[s, b]
                missing = hole - step[s]
                between = missing > 0.5 * step[s]
                past = between and missing > max_gap + 0.5 * step[s]
                share = 0.0 if past else (a - t[s, b]) / hole
            valid[k, s], filled[k, s] = not past, between and not past
            for c in range(3):
                acc[k, s, c], gyr[k, s, c] = x[s, b, c], x[s, b, 3 + c]
                if share != 0.0:
                    acc[k, s, c] += share * (x[s, b + 1, c] - x[s, b, c])
                    gyr[k, s, c] += share * (x[s, b + 1, 3 + c] - x[s, b, 3 + c])
        for k in range(b, n):
            t[s, k - b] = t[s, k]
            x[s, k - b] = x[s, k]
        count[s] = n - b


class Rows:
    """Rows of good samples by sensor, the first of them the last that the axis has passed.

    Parameters
    ----------
    widths : number of sensors of each stream; sensors are numbered through the streams. rates_hz : of each
        stream. rate_hz : of the axis.
    """

    def __init__(
        self, widths: Sequence[int], rates_hz: Sequence[float], rate_hz: float, params: TimelineParams
    ) -> None:
        n = sum(widths)
        self._rate, self._params = rate_hz, params
        self._stream: Ints = np.repeat(np.arange(len(widths)), widths)
        self._slots = [0, *np.cumsum(widths).tolist()]
        self._step: Floats = 1.0 / np.repeat(np.array(rates_hz), widths)
        self._t: Floats = np.full((n, 64), NEVER_S)
        self._x: Floats = np.zeros((n, 64, MEASURED))
        self._count: Ints = np.ones(n, np.int64)
        self.last_s: Floats = np.full(len(widths), -np.inf)
        """Time of each stream's last sample, good or not."""

    def append(
        self, stream: int, t_us: Micros, offset_us: int, samples: NDArray[np.float32], columns: Ints
    ) -> None:
        """Add samples (m, sensors, 9) of a stream, of which `columns` are worn, on the common clock."""
        slot = self._slots[stream]
        need = int(self._count[slot : slot + len(columns)].max()) + len(t_us)
        if need > self._t.shape[1]:
            more = ((0, 0), (0, need))
            self._t = np.pad(self._t, more)
            self._x = np.pad(self._x, (*more, (0, 0)))
        _append(t_us, offset_us, samples, columns, slot, self._t, self._x, self._count)
        self.last_s[stream] = (int(t_us[-1]) + offset_us) * 1e-6

    def until(self, live: Bools) -> float:
        """Time in s up to which the axis is known when only the live streams (m,) are waited for."""
        gap = self._params.max_gap_s
        return float(_until(live, self.last_s, self._stream, self._step, gap, self._t, self._count))

    def lay(self, first: int, past: int, start_s: float) -> tuple[Floats, Floats, Bools, Bools]:
        """acc, gyr (T, n, 3), valid, interpolated (T, n) of the axis' points first … past − 1."""
        shape = past - first, len(self._count)
        acc, gyr = np.empty((*shape, 3)), np.empty((*shape, 3))
        valid, filled = np.empty(shape, np.bool_), np.empty(shape, np.bool_)
        p = self._params
        _lay(
            first, start_s, self._rate, p.on_grid / self._rate, self._step, p.max_gap_s,
            self._t, self._x, self._count, acc, gyr, valid, filled,
        )  # fmt: skip
        return acc, gyr, valid, filled
