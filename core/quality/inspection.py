"""Inspection of an upload before sensors are assigned to segments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.formats.aliases import segment_in
from sagittal.core.frames import Segment
from sagittal.core.message import Message
from sagittal.core.quality.signals import measure_signal, measure_stream
from sagittal.core.quality.suggestion import Suggestion, suggest
from sagittal.core.quality.suspicion import list_suspicions
from sagittal.core.signals.held_samples import is_complete
from sagittal.core.signals.recording import ImuStream, Recording, Subject
from sagittal.core.signals.sample_blocks import LongStream


@dataclass(frozen=True)
class DeviceFacts:
    """One sensor as found.

    Parameters
    ----------
    samples : rows with a complete acceleration. lost_pct : missing between first and last, % of samples.
        longest_gap_s : longest gap, 0 = none. start_s : first sample relative to that of the recording.
        still_norm : mean |acc| of the quietest second, m/s².
    segment : as declared, None = not used or not declared (see `declared`).
    suggestion : segment suggested by name or movement.
    duplicate_of : id of the sensor with the same samples, else None.
    """

    device_id: str
    source: str
    rate_hz: float
    clock: str
    start_s: float
    duration_s: float
    samples: int
    lost_pct: float
    longest_gap_s: float
    has_gyro: bool
    has_mag: bool
    has_orientation: bool
    still_norm: float
    declared: bool
    segment: Segment | None
    suggestion: Suggestion
    duplicate_of: str | None
    notices: tuple[Notice, ...]

    def to_json(self) -> dict[str, object]:
        """Plain values, rounded for display."""
        return {
            "device_id": self.device_id,
            "source": self.source,
            "rate_hz": round(self.rate_hz, 3),
            "clock": self.clock,
            "start_s": round(self.start_s, 3),
            "duration_s": round(self.duration_s, 3),
            "samples": self.samples,
            "lost_pct": round(self.lost_pct, 2),
            "longest_gap_s": round(self.longest_gap_s, 3),
            "has_gyro": self.has_gyro,
            "has_mag": self.has_mag,
            "has_orientation": self.has_orientation,
            "units": {"acc": "m/s2", "gyr": "rad/s" if self.has_gyro else None},
            "still_norm_mps2": round(self.still_norm, 3),
            "declared": self.declared,
            "segment": self.segment,
            "suggested": self.suggestion.segment,
            "suggested_part": self.suggestion.part,
            "suggested_leg": self.suggestion.leg,
            "basis": self.suggestion.basis,
            "duplicate_of": self.duplicate_of,
            "notices": [n.to_json() for n in self.notices],
        }


@dataclass(frozen=True)
class Inspection:
    """Result of inspecting a whole upload."""

    devices: tuple[DeviceFacts, ...]
    duration_s: float
    subject: Subject
    protocol: str
    notices: tuple[Notice, ...]

    def to_json(self) -> dict[str, object]:
        """Plain values for the upload page."""
        return {
            "devices": [d.to_json() for d in self.devices],
            "duration_s": round(self.duration_s, 3),
            "subject": self.subject.to_json(),
            "protocol": self.protocol,
            "notices": [n.to_json() for n in self.notices],
        }


def describe(recording: Recording) -> Inspection:
    """Describe the content of an upload, sensor by sensor; never raises for a readable recording."""
    first: dict[str, str] = {}
    copies: dict[str, str] = {}
    for device, stream in recording.streams.items():
        original = first.setdefault(stream.digest, device)
        if original != device:
            copies[device] = original
    suggestions = suggest(recording)
    devices = []
    for device, stream in recording.streams.items():
        devices.append(
            _device(
                stream,
                declared=device in recording.segments,
                segment=recording.segments.get(device),
                suggestion=suggestions[device],
                duplicate_of=copies.get(device),
            )
        )
    starts = [float(s.t_s[0]) for s in recording.streams.values()]
    ends = [float(s.t_s[-1]) for s in recording.streams.values()]
    long = {d: s for d, s in recording.long.items() if d not in recording.streams}
    devices += [
        _long_device(s, declared=d in recording.segments, segment=recording.segments.get(d))
        for d, s in long.items()
    ]
    lasts = [max(ends) - min(starts)] if ends else []
    return Inspection(
        devices=tuple(devices),
        duration_s=max((*lasts, *(s.duration_s for s in long.values())), default=0.0),
        subject=recording.subject,
        protocol=recording.protocol,
        notices=recording.notices,
    )


LOOKED_AT_S: Final = 600.0
"""A sensor that is read block by block is described by its first minutes."""


def _long_device(s: LongStream, *, declared: bool, segment: Segment | None) -> DeviceFacts:
    """A sensor whose recording is too long for memory, from its file header and its first minutes."""
    blocks = []
    for block in s.open_blocks():
        blocks.append(block)
        if len(block.t_s) and block.t_s[-1] > LOOKED_AT_S:
            break
    t_s, acc = (np.concatenate([getattr(b, name) for b in blocks]) for name in ("t_s", "acc"))
    gyr = [b.gyr for b in blocks if b.gyr is not None]
    facts = measure_signal(acc, np.concatenate(gyr) if len(gyr) == len(blocks) else None, s.rate_hz)
    holes = np.diff(t_s) - 1.0 / s.rate_hz
    lost = float(np.where(holes > 0.5 / s.rate_hz, holes, 0.0).sum())
    guess = segment_in(s.device_id) or segment_in(s.source)
    return DeviceFacts(
        device_id=s.device_id,
        source=s.source,
        rate_hz=s.rate_hz,
        clock="device",
        start_s=0.0,
        duration_s=s.duration_s,
        samples=round(s.duration_s * s.rate_hz),
        lost_pct=100.0 * lost / max(float(t_s[-1] - t_s[0]), 1.0),
        longest_gap_s=float(holes.max(initial=0.0)),
        has_gyro=s.has_gyro,
        has_mag=False,
        has_orientation=False,
        still_norm=facts.still_norm,
        declared=declared,
        segment=segment,
        suggestion=Suggestion(guess, "label") if guess else Suggestion(),
        duplicate_of=None,
        notices=(
            *s.notices,
            Notice(
                "read_in_blocks",
                Message(
                    "Sensor {device_id} recorded {duration_s:.0f} h, which suits the daily-life "
                    "protocol. Its values here are from the first ten minutes.",
                    device_id=s.device_id,
                    duration_s=s.duration_s / 3600,
                ),
                s.device_id,
                severity="info",
            ),
        ),
    )


def _device(
    s: ImuStream,
    *,
    declared: bool,
    segment: Segment | None,
    suggestion: Suggestion,
    duplicate_of: str | None,
) -> DeviceFacts:
    f = measure_stream(s)
    lost, longest = measure_losses(s)
    notices = [*s.notices, *list_suspicions(s.device_id, f, s.acc, s.quat)]
    if duplicate_of is not None:
        notices.append(
            Notice(
                "duplicate_stream",
                Message(
                    "Sensor {device_id} holds the same samples as {duplicate_of}: a copy under another "
                    "id. Only the one that is assigned to a segment is analysed.",
                    device_id=s.device_id,
                    duplicate_of=duplicate_of,
                ),
                s.device_id,
            )
        )
    return DeviceFacts(
        device_id=s.device_id,
        source=s.source,
        rate_hz=s.rate_hz,
        clock=s.clock,
        start_s=float(s.t_s[0]),
        duration_s=float(s.t_s[-1] - s.t_s[0]),
        samples=int(np.count_nonzero(is_complete(s.held("acc")))),
        lost_pct=100.0 * lost,
        longest_gap_s=longest,
        has_gyro=s.gyr is not None,
        has_mag=s.mag is not None,
        has_orientation=s.quat is not None,
        still_norm=f.still_norm,
        declared=declared,
        segment=segment,
        suggestion=suggestion,
        duplicate_of=duplicate_of,
        notices=tuple(notices),
    )


def measure_losses(s: ImuStream) -> tuple[float, float]:
    """Fraction (0 to 1) of samples missing between a stream's first and last, and its longest gap in s."""
    good = is_complete(s.held("acc"))
    if s.gyr is not None:
        good = good & is_complete(s.held("gyr"))
    t = s.t_s[good]
    expected = round(float(s.t_s[-1] - s.t_s[0]) * s.rate_hz) + 1
    if len(t) < 2:
        return 1.0 if len(t) == 0 else 0.0, 0.0
    hole = float(np.diff(t).max()) - 1.0 / s.rate_hz
    longest = hole if hole > 0.5 / s.rate_hz else 0.0
    return float(np.clip(1.0 - len(t) / expected, 0.0, 1.0)), longest
