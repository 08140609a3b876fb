"""Recordings as a tablet would send them, and the output of the live chain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from unittest.mock import patch

import numpy as np

from sagittal.core.events.result import GaitEvent
from sagittal.core.formats.live_log import Hello, SampleBatch, SensorInfo, StreamInfo
from sagittal.core.frames import Floats, Side
from sagittal.core.online import LiveFrame, LiveStride, OnlineSession
from sagittal.core.online.chain import LiveChain
from sagittal.core.parameters.live.live_history import SampleHistory
from sagittal.core.signals.recording import UniformRecording


def hello_of(recording: UniformRecording) -> Hello:
    """All sensors of a recording as one stream."""
    sensors = tuple(SensorInfo(s, s, 160.0, 35.0) for s in recording.sensors)
    return Hello("take", "replay", (StreamInfo(0, recording.rate_hz, "shared", sensors),))


def samples_of(recording: UniformRecording) -> Floats:
    """(n, k, 9) as measured: NaN where a sensor was lost."""
    parts = []
    for x in recording.sensors.values():
        six = np.concatenate((x.acc, x.gyr, np.full((len(x.acc), 3), np.nan)), axis=1)
        six[~x.valid] = np.nan
        parts.append(six)
    return np.stack(parts, axis=1)


def batches(recording: UniformRecording, sizes: int | Sequence[int] = 10) -> Iterator[SampleBatch]:
    """The recording in batches of one size, or of these in turn, each sent when its last sample is there."""
    x = samples_of(recording).astype(np.float32)
    turn = [sizes] if isinstance(sizes, int) else list(sizes)
    first = seq = 0
    while first < len(x):
        past = min(len(x), first + turn[seq % len(turn)])
        t0, sent = (round(1e6 * k / recording.rate_hz) for k in (first, past - 1))
        offsets = np.round(1e6 * np.arange(first, past) / recording.rate_hz).astype(np.int64) - t0
        yield SampleBatch(0, seq, t0, sent, x[first:past], offsets.astype(np.uint32))
        first, seq = past, seq + 1


def live(
    recording: UniformRecording, sizes: int | Sequence[int] = 10
) -> tuple[OnlineSession, list[LiveFrame]]:
    """A take from its first batch to its last."""
    online = OnlineSession(hello_of(recording), recording.subject, recording.protocol)
    frames = [f for b in batches(recording, sizes) if (f := online.push(b)) is not None]
    return online, frames


def trails(frames: Sequence[LiveFrame]) -> tuple[Floats, dict[str, Floats]]:
    """Times and angles of all frames in a row."""
    notices = [f.trail for f in frames if f.trail.names]
    t = np.concatenate([x.t_s for x in notices])
    values = np.concatenate([x.values for x in notices])
    return t, {name: values[:, i] for i, name in enumerate(notices[0].names)}


@dataclass(frozen=True, eq=False)
class Run:
    """Live trial with all samples of its chain: name → (n, …) from `first` on."""

    online: OnlineSession
    frames: list[LiveFrame]
    rows: dict[str, Floats]

    @property
    def chain(self) -> LiveChain:
        chain = self.online.chain
        assert chain is not None
        return chain

    @property
    def events(self) -> list[GaitEvent]:
        """Last reported version of each event, by time."""
        result: dict[tuple[Side, str, float], GaitEvent] = {}
        for e in (e for f in self.frames for e in f.events):
            result[e.side, e.kind, e.time_s if e.first_s is None else e.first_s] = e
        return sorted(result.values(), key=lambda e: (e.time_s, e.side, e.kind))

    @property
    def strides(self) -> list[LiveStride]:
        """Strides as reported, most of them three times."""
        return [s for f in self.frames for s in f.strides]

    @property
    def angles_deg(self) -> dict[str, Floats]:
        """Angles over standing by name, (axis,) degrees, 0 before the chain begins."""
        initial_buffer = np.zeros((self.chain.first, len(self.chain.names)))
        whole = np.degrees(np.concatenate((initial_buffer, self.rows["angles"])))
        return {name: whole[:, i] for i, name in enumerate(self.chain.names)}

    def ankle(self, side: Side) -> Floats:
        """Path (axis, 3) of an ankle, NaN before the chain begins."""
        path = self.rows["feet_p"][:, list(self.chain.contact).index(side)]
        return np.concatenate((np.full((self.chain.first, 3), np.nan), path))


def recorded(recording: UniformRecording, sizes: int | Sequence[int] = 10) -> Run:
    """`live` with all that the chain measures on."""
    rows: list[dict[str, Floats]] = []
    append = SampleHistory.append

    def kept(history: SampleHistory, columns: Mapping[str, Floats]) -> None:
        rows.append({name: x.copy() for name, x in columns.items()})
        append(history, columns)

    with patch.object(SampleHistory, "append", kept):
        online, frames = live(recording, sizes)
    return Run(online, frames, {name: np.concatenate([r[name] for r in rows]) for name in rows[0]})
