"""One stream on its way to the axis: what came, what of it is needed still."""

from __future__ import annotations

from typing import Final

import numpy as np

from core.formats.live_clock import Micros
from core.formats.live_hello import StreamInfo
from core.formats.live_log import Batch
from core.frames import Bools, Floats
from core.timeline import Place, TimelineParams

NEVER_S: Final = -1e12
"""Time of the sample before the first: further back than any hole that is filled."""

MEASURED: Final = 6
"""Channels of a sample that must all be there: acc and gyr."""


class Line:
    """The worn sensors of one stream.

    Rows wait until the axis has passed them; of those it has passed, each sensor's last good one is kept.
    """

    def __init__(self, info: StreamInfo, slot: int, params: TimelineParams) -> None:
        self.stream, self.rate_hz = info.stream, info.rate_hz
        self._columns = [i for i, x in enumerate(info.sensors) if x.segment is not None]
        self.ids = tuple(info.sensors[i].id for i in self._columns)
        self.width = len(self._columns)
        self._all = self.width == len(info.sensors)
        self._slots = slice(slot, slot + self.width)
        self._params = params
        self.held: list[tuple[Micros, Floats, Bools]] = []
        self.samples = 0
        self.last_s = -np.inf
        self._first_us: int | None = None
        self._last_us = 0
        self._sent_us = 0
        self._span_us = 0
        k = self.width
        self._t, self._x, self._good = np.zeros(0), np.zeros((0, k, MEASURED)), np.ones((0, k), np.bool_)
        self._before_t, self._before_x = np.full(k, NEVER_S), np.zeros((k, MEASURED))
        self._whole = True  # every row of every sensor is good, the kept one included

    def hold(self, t_us: Micros, batch: Batch) -> bool:
        """Take a batch whose clock need not be aligned yet; tell whether samples ran backwards in time."""
        chosen = batch.samples if self._all else batch.samples[:, self._columns]
        x = chosen[:, :, :MEASURED].astype(np.float64)
        if self._first_us is None:
            self._first_us = int(t_us[0])
            self._last_us = self._first_us - 1
        backwards = False
        if t_us[0] <= self._last_us or (batch.offsets_us is not None and (np.diff(t_us) <= 0).any()):
            ahead = np.maximum.accumulate(np.concatenate(([self._last_us], t_us)))
            rising = np.asarray(t_us > ahead[:-1], np.bool_)
            backwards = not rising.all()
            t_us, x = t_us[rising], x[rising]
        self._sent_us = max(self._sent_us, batch.sent_us)
        if len(t_us):
            self._last_us = int(t_us[-1])
            self._span_us = int(t_us[-1] - t_us[0])
            self.samples += len(t_us)
            self.held.append((t_us, x, np.asarray(np.isfinite(x).all(axis=2), np.bool_)))
        return backwards

    def first_us(self) -> int:
        """Device clock of the first sample, µs."""
        return self._first_us or 0

    def ahead_s(self, first_us: int) -> float:
        """How far a batch that begins at this device time is after the last sample."""
        return 0.0 if self._first_us is None else (first_us - self._last_us) * 1e-6

    def whole_s(self, first_us: int) -> float:
        """How far a batch that begins at this device time is after the first sample."""
        return 0.0 if self._first_us is None else (first_us - self._first_us) * 1e-6

    def overdue_s(self, now_us: int) -> float:
        """How long, by the sender's clock, the next batch could have been there; inf before the first."""
        if self._first_us is None:
            return np.inf
        return (now_us - self._sent_us - self._span_us) * 1e-6

    def place(self, offset_us: int) -> None:
        """Put what is held on the common clock."""
        rows = self.held
        t = np.concatenate([self._t, *((t_us + offset_us) * 1e-6 for t_us, _, _ in rows)])
        self._x = np.concatenate([self._x, *(x for _, x, _ in rows)])
        self._good = np.concatenate([self._good, *(good for _, _, good in rows)])
        self._t, self.held = t, []
        self._whole = bool(self._good.all()) and bool((self._before_t == self._before_t[0]).all())
        self.last_s = float(t[-1])

    def known_until(self) -> float:
        """Time in s up to which every sensor of the stream can be laid on the axis.

        Up to its last good sample; beyond, once the hole is too long to be filled by any sample to come.
        """
        if self._whole and len(self._t):
            return self.last_s
        step = 1.0 / self.rate_hz
        good = np.where(self._good, self._t[:, None], NEVER_S)
        last = np.maximum(self._before_t, good.max(axis=0, initial=NEVER_S))
        lost = self.last_s - last - step > self._params.max_gap_s + 0.5 * step
        return float(np.where(lost, self.last_s, last).min())

    def lay(self, axis: Floats, rate: float, acc: Floats, gyr: Floats, valid: Bools, filled: Bools) -> None:
        """Write the stream's columns (T, width, …) of a block and forget what no later point needs."""
        if self._on_axis(axis, rate):
            laid = self._x
            valid[:, self._slots], filled[:, self._slots] = True, False
        elif self._whole:
            t = np.concatenate((self._before_t[:1], self._t))
            x = np.concatenate((self._before_x[None], self._x)).reshape(len(t), -1)
            place = Place.find(t, axis, self.rate_hz, rate, self._params)
            laid = place.values(x).reshape(len(axis), self.width, MEASURED)
            valid[:, self._slots] = place.valid[:, None]
            filled[:, self._slots] = place.filled[:, None]
        else:
            laid = np.empty((len(axis), self.width, MEASURED))
            for i in range(self.width):
                good = self._good[:, i]
                t = np.concatenate((self._before_t[i : i + 1], self._t[good]))
                x = np.concatenate((self._before_x[i : i + 1], self._x[good, i]))
                place = Place.find(t, axis, self.rate_hz, rate, self._params)
                laid[:, i] = place.values(x)
                valid[:, self._slots.start + i] = place.valid
                filled[:, self._slots.start + i] = place.filled
        acc[:, self._slots], gyr[:, self._slots] = laid[:, :, :3], laid[:, :, 3:]
        self._forget(float(axis[-1]) + self._params.on_grid / rate)

    def _on_axis(self, axis: Floats, rate: float) -> bool:
        """Tell whether the rows are the points themselves: the whole work on a single clock."""
        if not self._whole or len(axis) != len(self._t):
            return False
        return bool(np.abs(axis - self._t).max() <= self._params.on_grid / rate)

    def _forget(self, until_s: float) -> None:
        """Keep of the rows up to a time only each sensor's last good one."""
        n = int(np.searchsorted(self._t, until_s, side="right"))
        if not n:
            return
        for i in range(self.width) if not self._whole else ():
            good = np.flatnonzero(self._good[:n, i])
            if len(good):
                self._before_t[i], self._before_x[i] = self._t[good[-1]], self._x[good[-1], i]
        if self._whole:
            self._before_t[:], self._before_x[:] = self._t[n - 1], self._x[n - 1]
        self._t, self._x, self._good = self._t[n:], self._x[n:], self._good[n:]
        self._whole = bool(self._good.all()) and bool((self._before_t == self._before_t[0]).all())
