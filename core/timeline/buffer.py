"""Buffer of the good samples of a live recording that are waiting for the time axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sagittal.core.formats.live_clock import Micros
from sagittal.core.frames import Bools, Floats
from sagittal.core.timeline.grid import MEASURED, NEVER_S, append_good, find_known_until, lay_points
from sagittal.core.timeline.params import TimelineParams

Ints = NDArray[np.int64]


class SampleBuffer:
    """Rows of good samples by sensor, the first of them the last one before the current end of the axis.

    Parameters
    ----------
    widths : number of sensors of each stream; sensors are numbered consecutively across streams. rates_hz :
        of each stream. rate_hz : of the axis.
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
        """Add samples (m, sensors, 9) of a stream, of its used `columns`, on the common clock."""
        slot = self._slots[stream]
        need = int(self._count[slot : slot + len(columns)].max()) + len(t_us)
        if need > self._t.shape[1]:
            more = ((0, 0), (0, need))
            self._t = np.pad(self._t, more)
            self._x = np.pad(self._x, (*more, (0, 0)))
        append_good(t_us, offset_us, samples, columns, slot, self._t, self._x, self._count)
        self.last_s[stream] = (int(t_us[-1]) + offset_us) * 1e-6

    def until(self, live: Bools) -> float:
        """Time in s up to which the axis can be computed if only the live streams (m,) are waited for."""
        gap = self._params.max_gap_s
        return float(find_known_until(live, self.last_s, self._stream, self._step, gap, self._t, self._count))

    def lay(self, first: int, past: int, start_s: float) -> tuple[Floats, Floats, Bools, Bools]:
        """acc, gyr (T, n, 3), valid, interpolated (T, n) at the points first … past − 1 of the axis."""
        shape = past - first, len(self._count)
        out = np.empty((2, *shape, 3))
        valid, filled = np.empty(shape, np.bool_), np.empty(shape, np.bool_)
        p = self._params
        lay_points(
            first, start_s, self._rate, p.on_grid / self._rate, self._step, p.max_gap_s,
            self._t, self._x, self._count, out, valid, filled,
        )  # fmt: skip
        return out[0], out[1], valid, filled
