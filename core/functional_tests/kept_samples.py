"""Recent sensor samples retained by a guided test in real time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sagittal.core.frames import Floats, Segment
from sagittal.core.signals.recording import SensorSignals
from sagittal.core.timeline.live import UniformBlock


class KeptSamples:
    """The last samples of some columns, indexed by the axis."""

    def __init__(self, columns: int) -> None:
        self.first = self.end = 0
        self._size = 0
        self._signals = np.zeros((1 << 10, columns, 6))
        self._flags = np.zeros((1 << 10, columns, 2), np.bool_)

    def append(self, block: UniformBlock, columns: np.ndarray[Any, Any]) -> None:
        """Append the next samples of the axis."""
        n = len(block)
        if self._size + n > len(self._signals):
            self._grow(n)
        k = slice(self._size, self._size + n)
        self._signals[k, :, :3] = block.acc[:, columns]
        self._signals[k, :, 3:] = block.gyr[:, columns]
        self._flags[k, :, 0] = block.valid[:, columns]
        self._flags[k, :, 1] = block.interpolated[:, columns]
        self._size += n
        self.end = block.first + n

    def drop_before(self, sample: int) -> None:
        """Discard all samples before one of the axis."""
        self.first = max(self.first, min(sample, self.end))

    def cut(self, low: int, end: int, segments: Sequence[Segment]) -> dict[Segment, SensorSignals]:
        """Copies of the sensor signals in a range."""
        k = self._span(low, end)
        signals, flags = self._signals[k], self._flags[k]
        signals_by_segment: dict[Segment, SensorSignals] = {}
        for i, s in enumerate(segments):
            acc, gyr = np.ascontiguousarray(signals[:, i, :3]), np.ascontiguousarray(signals[:, i, 3:])
            signals_by_segment[s] = SensorSignals(
                s, acc, gyr, None, flags[:, i, 0].copy(), flags[:, i, 1].copy()
            )
        return signals_by_segment

    def _span(self, low: int, until: int) -> slice:
        zero = self.end - self._size
        return slice(max(0, max(low, self.first) - zero), max(0, until - zero))

    def _grow(self, n: int) -> None:
        """Make room: reclaim discarded samples, then double the capacity until it suffices."""
        used = self.end - self.first
        length = len(self._signals)
        while used + n > length // 2:
            length *= 2
        for name in ("_signals", "_flags"):
            old: Floats = getattr(self, name)
            new = np.zeros((length, *old.shape[1:]), old.dtype)
            new[:used] = old[self._size - used : self._size]
            setattr(self, name, new)
        self._size = used
