"""Live takes for tests: a recording cut into batches as a tablet sends them, and its log."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sagittal.core.formats.live_log import (
    FILE_MARK,
    Clock,
    Finish,
    Hello,
    SampleBatch,
    SensorInfo,
    StreamInfo,
    encode_batch,
    finish_json,
    hello_json,
    record,
)
from sagittal.core.signals.recording import ImuStream, Recording

Samples = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LiveTake:
    """Messages of a tablet."""

    hello: Hello
    batches: tuple[SampleBatch, ...]

    def finish(self) -> Finish:
        digest = hashlib.sha256()
        for b in self.batches:
            digest.update(np.ascontiguousarray(b.samples, "<f4").tobytes())
        return Finish(len(self.batches), digest.hexdigest())

    def log(self, *, finished: bool = True) -> bytes:
        """The file the recorder writes."""
        parts = [FILE_MARK, record("H", hello_json(self.hello))]
        parts += [record("B", encode_batch(b)) for b in self.batches]
        if finished:
            parts.append(record("F", finish_json(self.finish())))
        return b"".join(parts)

    def cut(self, n: int) -> LiveTake:
        """The same samples in batches of n."""
        parts: list[SampleBatch] = []
        for b in self.batches:
            rate = self.hello.stream(b.stream).rate_hz
            for i in range(0, len(b.samples), n):
                position = round(i * 1e6 / rate) if b.offsets_us is None else int(b.offsets_us[i])
                offsets = None if b.offsets_us is None else b.offsets_us[i : i + n] - b.offsets_us[i]
                parts.append(
                    replace(b, t0_us=b.t0_us + position, samples=b.samples[i : i + n], offsets_us=offsets)
                )
        return LiveTake(self.hello, tuple(replace(b, seq=k) for k, b in enumerate(parts)))


@dataclass(frozen=True, eq=False)
class Device:
    """One device clock and its sensors.

    Parameters
    ----------
    t_us : (n,) device clock. samples : (n, k, 9). delay_us : from a batch's last sample to its sending.
    ahead_us : device clock less the sender's, drift : of the device clock, 1 = none; both only for `send`.
    jitter : send the times of the single samples.
    """

    info: StreamInfo
    t_us: NDArray[np.int64]
    samples: Samples
    delay_us: int = 20_000
    ahead_us: int = 0
    drift: float = 1.0
    jitter: bool = False


def sensor_samples(stream: ImuStream) -> Samples:
    """acc, gyr, mag (n, 9) of a stream, NaN where it has none."""
    out = np.full((len(stream.t_s), 9), np.nan, np.float32)
    for k, x in enumerate((stream.acc, stream.gyr, stream.mag)):
        if x is not None:
            out[:, 3 * k : 3 * k + 3] = x
    return out


def shared(
    recording: Recording, start_us: int = 1_000_000, number: int = 0, clock: Clock = "shared"
) -> Device:
    """All sensors of a recording on one clock; missing rows are NaN."""
    segments = [(d, s) for d, s in recording.segments.items() if s is not None]
    rate = recording.streams[segments[0][0]].rate_hz
    rows = {d: np.rint(recording.streams[d].t_s * rate).astype(np.int64) for d, _ in segments}
    ticks = np.unique(np.concatenate(list(rows.values())))
    samples = np.full((len(ticks), len(segments), 9), np.nan, np.float32)
    for i, (d, _) in enumerate(segments):
        samples[np.searchsorted(ticks, rows[d]), i] = sensor_samples(recording.streams[d])
    info = StreamInfo(number, rate, clock, tuple(SensorInfo(d, s) for d, s in segments))
    return Device(info, start_us + np.rint((ticks - ticks[0]) * 1e6 / rate).astype(np.int64), samples)


def send(devices: Sequence[Device], n: int = 10, take: str = "take") -> LiveTake:
    """Batches of up to n samples in sending order; a gap without offsets starts a new batch."""
    sent: list[tuple[int, int, SampleBatch]] = []
    for d in devices:
        step = 1e6 / d.info.rate_hz
        true_us = np.rint((d.t_us - d.ahead_us) / d.drift).astype(np.int64)
        holes = [] if d.jitter else (np.flatnonzero(np.diff(d.t_us) > 1.5 * step) + 1).tolist()
        for first, past in zip([0, *holes], [*holes, len(d.t_us)], strict=True):
            for a in range(first, past, n):
                b = min(a + n, past)
                position = int(true_us[b - 1]) + d.delay_us
                offsets = (d.t_us[a:b] - d.t_us[a]).astype(np.uint32) if d.jitter else None
                batch = SampleBatch(d.info.stream, 0, int(d.t_us[a]), position, d.samples[a:b], offsets)
                sent.append((position, d.info.stream, batch))
    sent.sort(key=lambda x: x[:2])
    hello = Hello(take, "replay", tuple(d.info for d in devices))
    return LiveTake(hello, tuple(replace(b, seq=k) for k, (_, _, b) in enumerate(sent)))


SENSORS = (SensorInfo("A1", "foot_l", 160.0, 35.0), SensorInfo("ö 2", None))
SMALL_HELLO = Hello("take-1", "dot", (StreamInfo(3, 100.0, "shared", SENSORS),))


def small_batch(seq: int = 0, n: int = 5, offsets: bool = False) -> SampleBatch:
    """Noise of two sensors without magnetometer."""
    samples = np.random.default_rng(1 + seq).normal(size=(n, 2, 9)).astype(np.float32)
    samples[:, :, 6:] = np.nan
    position = 1_000_000 + seq * n * 10_000
    steps = np.arange(n, dtype=np.uint32) * np.uint32(10_000) if offsets else None
    return SampleBatch(3, seq, position, position + 70_000, samples, steps)


def small(n: int = 3) -> LiveTake:
    """n small batches."""
    return LiveTake(SMALL_HELLO, tuple(small_batch(i) for i in range(n)))
