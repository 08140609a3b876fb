"""One stream of a live recording before resampling: its clock so far, and queued batches."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.formats.live_clock import Micros
from sagittal.core.formats.live_hello import StreamInfo
from sagittal.core.formats.live_log import SampleBatch

LONGEST_SPAN_US: Final = 1_000_000
"""A sender may gather samples for so long; a stream is not overdue while its usual batch can be gathered."""


class StreamQueue:
    """Queue of the sensors of one stream that are mapped to a segment."""

    def __init__(self, info: StreamInfo) -> None:
        used = [i for i, x in enumerate(info.sensors) if x.segment is not None]
        self.stream, self.rate_hz = info.stream, info.rate_hz
        self.columns = np.array(used, np.int64)
        self.ids = tuple(info.sensors[i].id for i in used)
        self.held: list[tuple[Micros, NDArray[np.float32]]] = []
        self.samples = 0
        self.heard = False
        self.first_us = 0
        self._last_us = 0
        self._sent_us = 0
        self._span_us = 0

    def hold(self, t_us: Micros, batch: SampleBatch) -> bool:
        """Add a batch; returns whether samples with decreasing times were dropped."""
        if not self.heard:
            self.heard, self.first_us = True, int(t_us[0])
            self._last_us = self.first_us - 1
        samples, backwards = batch.samples, False
        if t_us[0] <= self._last_us or (batch.offsets_us is not None and (t_us[1:] <= t_us[:-1]).any()):
            ahead = np.maximum.accumulate(np.concatenate(([self._last_us], t_us)))
            rising = t_us > ahead[:-1]
            backwards = not rising.all()
            t_us, samples = t_us[rising], samples[rising]
        self._sent_us = max(self._sent_us, batch.sent_us)
        if len(t_us):
            self._last_us = int(t_us[-1])
            self._span_us = min(max(self._span_us, int(t_us[-1] - t_us[0])), LONGEST_SPAN_US)
            self.samples += len(t_us)
            self.held.append((t_us, samples))
        return backwards

    def ahead_s(self, first_us: int) -> float:
        """Time from the last sample to a batch that begins at this device time."""
        return (first_us - self._last_us) * 1e-6 if self.heard else 0.0

    def whole_s(self, first_us: int) -> float:
        """Time from the first sample to a batch that begins at this device time."""
        return (first_us - self.first_us) * 1e-6 if self.heard else 0.0

    def overdue_s(self, now_us: int) -> float:
        """Delay of the next batch by the sender's clock; inf before the first."""
        return (now_us - self._sent_us - self._span_us) * 1e-6 if self.heard else np.inf
