"""Health of every sensor: rate, losses, saturation and silence over the last seconds, from its batches."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from sagittal.core.formats.live_log import Hello, SampleBatch, StreamInfo
from sagittal.core.frames import Segment
from sagittal.core.online.frame import SensorHealth

OVER_S: Final = 5.0
"""Shares are of so long: a hole shows for as long as a person needs to see it."""

FULL: Final = 0.995
"""A component beyond this share of its range is at its end."""


class _Piece(NamedTuple):
    """A batch: device times of its start and end, counts (k, 2) of measured and of saturated samples."""

    start_us: int
    end_us: int
    counts: NDArray[np.int64]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _count(samples, limit, counts):  # type: ignore[no-untyped-def]
    """Count (k, 2) the complete samples (m, k, 9), and the saturated ones given the limits (k, 6)."""
    counts[:] = 0
    for i in range(samples.shape[1]):
        for s in range(samples.shape[0]):
            whole, full = True, False
            for c in range(limit.shape[1]):
                x = samples[s, i, c]
                whole = whole and np.isfinite(x)
                full = full or abs(x) >= limit[i, c]
            counts[i, 0] += whole
            counts[i, 1] += full


class _StreamHealth:
    """The last seconds of one stream."""

    def __init__(self, info: StreamInfo) -> None:
        self.info = info
        self._limit = np.array(
            [[x.acc_range or np.inf] * 3 + [x.gyr_range or np.inf] * 3 for x in info.sensors], np.float32
        ) * np.float32(FULL)
        self._pieces: deque[_Piece] = deque()
        self._total = np.zeros((len(info.sensors), 2), np.int64)
        self._told: list[tuple[object, SensorHealth] | None] = [None] * len(info.sensors)
        self._said: tuple[object, ...] = ()
        self._found: list[SensorHealth] = []
        self.sent_us: int | None = None

    def push(self, batch: SampleBatch) -> None:
        """Add a batch."""
        self.sent_us = batch.sent_us
        step_us = round(1e6 / self.info.rate_hz)
        x, offsets_us = batch.samples, batch.offsets_us
        last_us = (len(x) - 1) * step_us if offsets_us is None else int(offsets_us[-1])
        counts = np.empty(self._total.shape, np.int64)
        _count(x, self._limit, counts)
        end_us = batch.t0_us + last_us + step_us
        self._pieces.append(_Piece(batch.t0_us, end_us, counts))
        self._total += counts
        while end_us - self._pieces[0].end_us > OVER_S * 1e6:
            self._total -= self._pieces.popleft().counts

    def read_health(
        self,
        silent_s: float,
        still: Collection[Segment],
        stuck: Collection[Segment],
        doubts: Mapping[Segment, str],
    ) -> list[SensorHealth]:
        """Health of the sensors of the stream."""
        span_s = 1e-6 * (self._pieces[-1].end_us - self._pieces[0].start_us) if self._pieces else 1.0
        totals = self._total.tolist()
        inputs = span_s, totals, silent_s, list(still), list(stuck), dict(doubts)
        if inputs == self._said:
            return self._found
        expected = max(1.0, span_s * self.info.rate_hz)
        health_rows = []
        for i, (measured, full) in enumerate(totals):
            sensor = self.info.sensors[i]
            segment = sensor.segment
            doubt = None if segment is None else doubts.get(segment)
            now = span_s, measured, full, silent_s, segment in still, segment in stuck, doubt
            cached = self._told[i]
            if cached is None or cached[0] != now:
                health = SensorHealth(
                    id=sensor.id,
                    segment=segment,
                    rate_hz=measured / max(span_s, 1e-6),
                    lost_share=min(1.0, max(0.0, 1.0 - measured / expected)),
                    saturated_share=full / max(1, measured),
                    silent_s=silent_s,
                    still=segment in still,
                    stuck=segment in stuck,
                    doubt=doubt,
                )
                self._told[i] = cached = now, health
            health_rows.append(cached[1])
        self._said, self._found = inputs, health_rows
        return health_rows


class SensorHealthMonitor:
    """All sensors of a recording, including those without a segment."""

    def __init__(self, hello: Hello) -> None:
        self._streams = {info.stream: _StreamHealth(info) for info in hello.streams}
        self._begun_us: int | None = None
        self._now_us = 0

    def push(self, batch: SampleBatch) -> None:
        """Add a batch of a known stream."""
        self._streams[batch.stream].push(batch)
        if self._begun_us is None:
            self._begun_us = batch.sent_us
        self._now_us = max(self._now_us, batch.sent_us)

    def read_health(
        self,
        still: Collection[Segment],
        stuck: Collection[Segment] = (),
        doubts: Mapping[Segment, str] | None = None,
    ) -> tuple[SensorHealth, ...]:
        """Every sensor in the order of the hello.

        Parameters
        ----------
        still : segments at rest. stuck : those that do not measure. doubts : segment → code of an
            inconsistency.
        """
        health: list[SensorHealth] = []
        for stream in self._streams.values():
            since = stream.sent_us if stream.sent_us is not None else self._begun_us
            silent_s = 0.0 if since is None else 1e-6 * (self._now_us - since)
            health += stream.read_health(silent_s, still, stuck, doubts or {})
        return tuple(health)
