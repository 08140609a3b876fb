"""Division of a recording into batches as sent by a tablet, with their due times.

Sensors whose samples share a time grid form one stream; missing samples are NaN. A sensor with its own sample
times forms a stream with offsets. The sender's clock is the recording's: each playback sends the same bytes
at any speed.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.errors import InputError
from sagittal.core.formats.live_log import (
    CHANNELS,
    MOST_SAMPLES,
    Hello,
    SampleBatch,
    SensorInfo,
    StreamInfo,
    encode_batch,
)
from sagittal.core.frames import Floats
from sagittal.core.message import Message
from sagittal.core.signals.recording import ImuStream, Recording
from sagittal.core.signals.rest import find_runs

ON_GRID: Final = 0.01
"""Maximum distance from the grid in samples, as in core/timeline."""


@dataclass(frozen=True)
class DueBatch:
    """A batch and the due time of its last sample, in seconds from the first sample of the recording."""

    at_s: float
    frame: bytes


@dataclass
class _Grid:
    """Sensors on one grid: sample `tick` is at start_s + tick / rate_hz."""

    rate_hz: float
    start_s: float
    sensors: list[tuple[str, ImuStream]]

    def ticks(self, stream: ImuStream) -> Floats | None:
        """Ticks of a sensor's samples, None if they are not on this grid."""
        positions: Floats = (stream.t_s - self.start_s) * self.rate_hz
        whole: Floats = np.rint(positions)
        return (
            whole
            if np.abs(positions - whole).max() <= ON_GRID and len(np.unique(whole)) == len(positions)
            else None
        )


def hello_of(recording: Recording, take: str) -> Hello:
    """Hello message for a replay of this recording; mapped sensors, or all if none is mapped."""
    return Hello(
        take,
        "cli",
        tuple(
            StreamInfo(
                number,
                grid.rate_hz,
                "shared",
                tuple(SensorInfo(device, recording.segments.get(device)) for device, _ in grid.sensors),
            )
            for number, grid in enumerate(_grids(recording))
        ),
    )


def cut(recording: Recording, per_batch: int) -> list[DueBatch]:
    """All batches in order of their due times.

    Parameters
    ----------
    per_batch : samples per batch, 1 to 1000.

    Raises
    ------
    InputError `batch_size`.
    """
    if not 1 <= per_batch <= MOST_SAMPLES:
        raise InputError(
            "batch_size",
            Message(
                "{per_batch} samples per batch; choose 1 to {MOST_SAMPLES}.",
                per_batch=per_batch,
                MOST_SAMPLES=MOST_SAMPLES,
            ),
        )
    grids = _grids(recording)
    begin_s = min(s.t_s[0] for grid in grids for _, s in grid.sensors)
    pieces = sorted(
        (piece for number, grid in enumerate(grids) for piece in _pieces(number, grid, per_batch, begin_s)),
        key=lambda piece: (piece[0], piece[1].stream),
    )
    batches = []
    for seq, (at_us, b) in enumerate(pieces):
        batch = SampleBatch(b.stream, seq, b.t0_us, at_us, b.samples, b.offsets_us)
        batches.append(DueBatch(at_us * 1e-6, encode_batch(batch)))
    return batches


async def pace_batches(batches: Sequence[DueBatch], speed: float) -> AsyncIterator[bytes]:
    """Yield batches when due; `speed` 2 = twice as fast, 0 = immediately."""
    loop = asyncio.get_running_loop()
    began = loop.time()
    for one in batches:
        if speed > 0:
            await asyncio.sleep(max(0.0, began + one.at_s / speed - loop.time()))
        yield one.frame


def _grids(recording: Recording) -> list[_Grid]:
    mapped = [
        d for d, segment in recording.segments.items() if segment is not None and d in recording.streams
    ]
    grids: list[_Grid] = []
    for device in mapped or recording.streams:
        stream = recording.streams[device]
        for grid in grids:
            if grid.rate_hz == stream.rate_hz and grid.ticks(stream) is not None:
                grid.sensors.append((device, stream))
                break
        else:
            grids.append(_Grid(stream.rate_hz, float(stream.t_s[0]), [(device, stream)]))
    return grids


def _pieces(number: int, grid: _Grid, per_batch: int, begin_s: float) -> Iterator[tuple[int, SampleBatch]]:
    """Due time in µs and the batch without its sequence number."""
    first = grid.sensors[0][1]
    if grid.ticks(first) is None:
        t_us = np.rint((first.t_s - begin_s) * 1e6).astype(np.int64)
        samples = _channels(first)[:, None]
        for i in range(0, len(t_us), per_batch):
            t = t_us[i : i + per_batch]
            offsets = (t - t[0]).astype(np.uint32)
            yield int(t[-1]), SampleBatch(number, 0, int(t[0]), 0, samples[i : i + per_batch], offsets)
        return
    ticks = [np.asarray(grid.ticks(s), np.int64) for _, s in grid.sensors]
    lowest = min(int(t[0]) for t in ticks)
    samples = np.full((max(int(t[-1]) for t in ticks) - lowest + 1, len(ticks), CHANNELS), np.nan, np.float32)
    for k, ((_, stream), t) in enumerate(zip(grid.sensors, ticks, strict=True)):
        samples[t - lowest, k] = _channels(stream)
    present = np.zeros(len(samples), bool)
    present[np.concatenate(ticks) - lowest] = True
    for i, j in _runs(present, per_batch):
        t0, last = (round((grid.start_s - begin_s + (lowest + x) / grid.rate_hz) * 1e6) for x in (i, j - 1))
        yield last, SampleBatch(number, 0, t0, 0, samples[i:j])


def _runs(present: np.ndarray[tuple[int], np.dtype[np.bool_]], most: int) -> Iterator[tuple[int, int]]:
    """Runs of limited length without ticks at which no sensor measured."""
    for start, stop in find_runs(present):
        for i in range(start, stop, most):
            yield i, min(i + most, stop)


def _channels(stream: ImuStream) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
    """(n, 9) acc, gyr, mag; NaN if missing."""
    nothing = np.full_like(stream.acc, np.nan)
    parts = [x if x is not None else nothing for x in (stream.acc, stream.gyr, stream.mag)]
    return np.concatenate(parts, axis=1).astype(np.float32)
