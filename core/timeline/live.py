"""Batches of several device clocks → ONE uniform axis, sample by sample.

The rules are those of a file: highest rate, common start, samples on the axis copied, others interpolated,
gaps of up to 0.1 s filled. A point is output once every stream has the required samples, so for a recording
without disturbances the axis equals that of the finished file bit for bit. One rule has no equivalent in
files: a stream without data is skipped, and its sensors are invalid until it returns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import floor

import numpy as np

from sagittal.core.errors import Notice, SignalError
from sagittal.core.formats.live_clock import LiveClock, sample_times_us
from sagittal.core.formats.live_log import (
    Hello,
    SampleBatch,
    SensorInfo,
    StreamInfo,
    decode_batch,
    encode_batch,
)
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.timeline.buffer import SampleBuffer
from sagittal.core.timeline.params import TimelineParams
from sagittal.core.timeline.queue import StreamQueue


@dataclass(frozen=True)
class LiveAxisParams:
    """Limits of the live axis.

    Parameters
    ----------
    silent_s : a stream overdue by this time, by the sender's clock, is skipped; longer than any interpolated
        gap, shorter than the 0.5 s after which the patient is informed that the display is frozen.
    wait_s : waiting time at the start for streams without data. Independent clocks need one second to be
        aligned.
    behind_s : a stream with a longer delay than any radio link causes is skipped too.
    jump_s : largest lead of a clock relative to the sender's clock. longest_s : longest pause of a stream.
    Batches that exceed either are dropped, so that no invalid number can make the axis endless. All are our
    choice.
    """

    timeline: TimelineParams = field(default_factory=TimelineParams)
    silent_s: float = 0.3
    wait_s: float = 3.0
    behind_s: float = 5.0
    jump_s: float = 10.0
    longest_s: float = 600.0


@dataclass(frozen=True, eq=False)
class UniformBlock:
    """The next samples of the axis.

    Parameters
    ----------
    first : index of the first one on the axis; blocks are contiguous.
    t_s : (T,) seconds from the first sample of the axis, as `UniformRecording.t_s`.
    acc, gyr : (T, n, 3) m/s², rad/s of the n sensors in the order of `LiveAxis.segments`; always finite,
        invalid samples hold the last value (0 before the first).
    valid : (T, n) measured or interpolated over ≤ 0.1 s. interpolated : (T, n) filled.
    out : (T, n) of a sensor that was found not to measure and is permanently excluded; None = not checked.
    """

    first: int
    t_s: Floats
    acc: Floats
    gyr: Floats
    valid: Bools
    interpolated: Bools
    out: Bools | None = None

    def __len__(self) -> int:
        return len(self.t_s)


class LiveAxis:
    """The axis of a live recording: a pure function of its batches in order.

    Parameters
    ----------
    hello : its streams; only sensors with a segment are used.

    Raises
    ------
    SignalError `no_mapping`, `sample_rate_too_low`, as `synchronise`.
    """

    def __init__(self, hello: Hello, params: LiveAxisParams | None = None) -> None:
        self.params = params or LiveAxisParams()
        self._clock = LiveClock(hello)
        self._rates = {s.stream: s.rate_hz for s in hello.streams}
        queues = [StreamQueue(info) for info in hello.streams]
        self._queues = {q.stream: q for q in queues if q.ids}
        self.segments: tuple[Segment, ...] = tuple(x.segment for x in hello.sensors if x.segment is not None)
        """Worn segments in the order of the block's columns."""
        self.rate_hz = _common_rate(list(self._queues.values()), hello, self.params.timeline)
        queues = list(self._queues.values())
        self._buffer = SampleBuffer(
            [len(x.ids) for x in queues], [x.rate_hz for x in queues], self.rate_hz, self.params.timeline
        )
        self._origin: tuple[int, int] | None = None  # stream and device time of the very first sample
        self._origin_us = 0
        self._start_s: float | None = None
        self._next = 0
        self._sent: tuple[int, int] | None = None  # smallest and largest sending time so far, µs
        self._notified: dict[tuple[str, int], Notice] = {}
        self._fresh: list[Notice] = []

    @property
    def length(self) -> int:
        """Number of samples on the axis so far."""
        return self._next

    def push(self, batch: SampleBatch) -> UniformBlock | None:
        """Add the next batch; returns the newly available samples of the axis, None without any."""
        rate = self._rates[batch.stream]
        t_us = sample_times_us(batch, rate)
        self._clock.push(batch.stream, int(t_us[0]), int(t_us[-1]), batch.sent_us)
        earliest, latest = self._sent or (batch.sent_us, batch.sent_us)
        self._sent = min(earliest, batch.sent_us), max(latest, batch.sent_us)
        if self._origin is None:
            self._origin = batch.stream, int(t_us[0])
        queue = self._queues.get(batch.stream)
        if queue is not None:
            if self._is_jump(queue, int(t_us[0]), batch.sent_us):
                return None
            if queue.hold(t_us, batch):
                self._notify(
                    "out_of_order", queue, "sent samples with decreasing time stamps; they are excluded."
                )
        if self._start_s is None and not self._begin():
            return None
        for i, x in enumerate(self._queues.values()):
            if x.held and (offset := self._clock.offset_us(x.stream)) is not None:
                for t_us, samples in x.held:
                    self._buffer.append(i, t_us, offset - self._origin_us, samples, x.columns)
                x.held = []
        return self._emit()

    def drain_notices(self) -> tuple[Notice, ...]:
        """Notices since the last call."""
        fresh, self._fresh = tuple(self._fresh), []
        return fresh

    def _begin(self) -> bool:
        """Set origin and start once all streams, or those that arrived in time, have data; False before
        that.
        """
        assert self._sent is not None  # noqa: S101 - set before the first call
        assert self._origin is not None  # noqa: S101
        heard = [x for x in self._queues.values() if x.held and self._clock.offset_us(x.stream) is not None]
        late = self._sent[1] - self._sent[0] > self.params.wait_s * 1e6
        stream, first_us = self._origin
        offset = self._clock.offset_us(stream, final=not late)
        if not heard or offset is None or (len(heard) < len(self._queues) and not late):
            return False
        self._origin_us = first_us + offset
        for x in self._queues.values():
            if x not in heard:
                self._notify("sensor_missing", x, "has sent no data so far; recording continues without it.")
        starts = [x.first_us + (self._clock.offset_us(x.stream) or 0) - self._origin_us for x in heard]
        self._start_s = float(max(starts) * 1e-6)
        return True

    def _emit(self) -> UniformBlock | None:
        """Resample all available data onto the axis."""
        assert self._start_s is not None  # noqa: S101 - set before the first call
        assert self._sent is not None  # noqa: S101
        p, last_s = self.params, self._buffer.last_s
        furthest = last_s.max()
        live = last_s == furthest  # of a single stream, and where the senders' clocks are of no use
        if len(last_s) > 1:
            due = [x.overdue_s(self._sent[1]) <= p.silent_s for x in self._queues.values()]
            awaited = np.array(due) & (last_s >= furthest - p.behind_s)
            live = awaited if awaited.any() else live
        until = self._buffer.until(live)
        # a little less than `on_grid`, so that rounding never gives out a point that its sample is not on
        past = floor((until - self._start_s) * self.rate_hz + 0.9 * p.timeline.on_grid) + 1
        if past <= self._next:
            return None
        first, self._next = self._next, past
        t_s = np.arange(first, past) / self.rate_hz
        return UniformBlock(first, t_s, *self._buffer.lay(first, past, self._start_s))

    def _is_jump(self, queue: StreamQueue, first_us: int, sent_us: int) -> bool:
        """Whether a batch is implausibly far ahead of its stream."""
        ahead_s = queue.ahead_s(first_us)
        allowed = max(0.0, queue.overdue_s(sent_us)) + self.params.jump_s
        stretch = self.params.timeline.max_stretch * queue.samples / queue.rate_hz + self.params.longest_s
        if ahead_s <= min(allowed, self.params.longest_s) and queue.whole_s(first_us) <= stretch:
            return False
        self._notify("clock_jump", queue, "has a clock jump; batches after the jump are excluded.")
        return True

    def _notify(self, code: str, queue: StreamQueue, text: str) -> None:
        """Add a notice about a stream, once."""
        if (code, queue.stream) in self._notified:
            return
        notice = Notice(
            code,
            Message("{ids} {what}", ids=", ".join(queue.ids), what=text),
            queue.ids[0],
            self._next / self.rate_hz,
        )
        self._notified[code, queue.stream] = notice
        self._fresh.append(notice)


def _common_rate(queues: Sequence[StreamQueue], hello: Hello, params: TimelineParams) -> float:
    if not queues:
        named = ", ".join(x.id for x in hello.sensors)
        raise SignalError(
            "no_mapping",
            Message(
                "No sensor is assigned to a segment; assign the sensors (available: {named}).", named=named
            ),
        )
    slowest = min(queues, key=lambda x: x.rate_hz)
    if slowest.rate_hz < params.min_rate_hz:
        raise SignalError(
            "sample_rate_too_low",
            Message(
                "Sensor {ids} sends {rate_hz:g} Hz; at least {min_rate_hz:g} Hz are needed to find "
                "foot contacts. Set it to 60 Hz or more.",
                ids=slowest.ids[0],
                rate_hz=slowest.rate_hz,
                min_rate_hz=params.min_rate_hz,
            ),
            sensor=slowest.ids[0],
        )
    return max(x.rate_hz for x in queues)


def compile_axis_kernels() -> None:
    """Compile the kernels or load them from the cache, for samples with the memory layout of decoded
    frames.
    """
    hello = Hello("", "cli", (StreamInfo(0, 100.0, "shared", (SensorInfo("", "pelvis"),)),))
    axis = LiveAxis(hello)
    for seq in range(2):
        time_us = 10_000 * seq
        axis.push(
            decode_batch(encode_batch(SampleBatch(0, seq, time_us, time_us, np.zeros((1, 1, 9), np.float32))))
        )
