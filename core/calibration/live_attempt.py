"""Samples of one calibration attempt: the last seconds of standing, all of walking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sagittal.core.frames import Bools, Protocol, Segment
from sagittal.core.signals.recording import SensorSignals, Subject, UniformRecording
from sagittal.core.timeline.live import UniformBlock


@dataclass(frozen=True)
class WornSensors:
    """Sensors and subject of a recording, known before its first sample.

    Parameters
    ----------
    segments : in the order of the blocks' columns. mounting : segment → declared placement, free text.
    """

    segments: tuple[Segment, ...]
    rate_hz: float
    subject: Subject
    protocol: Protocol
    mounting: Mapping[str, str]


class CalibrationSamples:
    """Samples of the time axis from `first` on; the oldest can be dropped."""

    def __init__(self, wearer: WornSensors, first: int) -> None:
        n = len(wearer.segments)
        self.wearer, self.first, self.past = wearer, first, first
        self._acc, self._gyr = [np.zeros((0, n, 3))], [np.zeros((0, n, 3))]
        self._valid, self._filled = [np.zeros((0, n), np.bool_)], [np.zeros((0, n), np.bool_)]

    def __len__(self) -> int:
        return self.past - self.first

    def append(self, block: UniformBlock, start: int, stop: int) -> None:
        """Append the rows of a block, which must be contiguous with the previous ones."""
        self._acc.append(block.acc[start:stop])
        self._gyr.append(block.gyr[start:stop])
        self._valid.append(block.valid[start:stop])
        self._filled.append(block.interpolated[start:stop])
        self.past += stop - start

    def keep_last(self, n: int) -> None:
        """Drop all but the last n samples."""
        self._join()
        if len(self) > n:
            self._acc, self._gyr = [self._acc[0][-n:].copy()], [self._gyr[0][-n:].copy()]
            self._valid, self._filled = [self._valid[0][-n:].copy()], [self._filled[0][-n:].copy()]
            self.first = self.past - n

    def valid(self, last: int) -> Bools:
        """Validity (m, k) of at most the `last` samples."""
        self._join()
        return self._valid[0][-last:]

    def recording(self, segments: Sequence[Segment]) -> UniformRecording:
        """The samples of some segments as a separate recording, t_s from 0."""
        self._join()
        w = self.wearer
        return UniformRecording(
            t_s=np.arange(len(self)) / w.rate_hz,
            rate_hz=w.rate_hz,
            sensors={s: self._signals(s) for s in segments},
            subject=w.subject,
            protocol=w.protocol,
            mounting=w.mounting,
        )

    def _join(self) -> None:
        if len(self._acc) > 1:
            self._acc, self._gyr = [np.concatenate(self._acc)], [np.concatenate(self._gyr)]
            self._valid, self._filled = [np.concatenate(self._valid)], [np.concatenate(self._filled)]

    def _signals(self, segment: Segment) -> SensorSignals:
        i = self.wearer.segments.index(segment)
        acc, gyr = self._acc[0][:, i].copy(), self._gyr[0][:, i].copy()
        valid, filled = self._valid[0][:, i].copy(), self._filled[0][:, i].copy()
        return SensorSignals(segment, acc, gyr, None, valid, filled)
