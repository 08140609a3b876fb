"""Current standing: which segments are still, for how long, and the vertical in each sensor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sagittal.core.frames import Floats, Segment
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import RestParams, find_windows, measure_quietness


@dataclass(frozen=True)
class StandingNow:
    """Segments that are currently still, how long all have been still, and the longest rest so far."""

    still: frozenset[Segment]
    stood_s: float
    longest_s: float


def judge_standing(recording: UniformRecording, params: RestParams) -> StandingNow:
    """Judge by the rules of core/signals/rest.py; the last second determines the current state."""
    rate, n = recording.rate_hz, len(recording.t_s)
    quiet = {s: measure_quietness(x, rate, params).quiet for s, x in recording.sensors.items()}
    if not quiet or not n:
        return StandingNow(frozenset(), 0.0, 0.0)
    windows = find_windows(np.logical_and.reduce(list(quiet.values())), rate, params)
    lasting = [b - a for a, b in windows if round(b * rate) >= n]
    return StandingNow(
        frozenset(s for s, x in quiet.items() if x[-1]),
        lasting[-1] if lasting else 0.0,
        max((b - a for a, b in windows), default=0.0),
    )


def cut_last_part(recording: UniformRecording, seconds: float) -> UniformRecording:
    """The last seconds of a recording."""
    part = slice(-round(seconds * recording.rate_hz), None)
    sensors = {
        s: replace(
            x, acc=x.acc[part], gyr=x.gyr[part], valid=x.valid[part], interpolated=x.interpolated[part]
        )
        for s, x in recording.sensors.items()
    }
    return replace(recording, t_s=recording.t_s[part], sensors=sensors)


def find_upward_axes(recording: UniformRecording) -> dict[Segment, Floats]:
    """Unit vector (3,) of the vertical in sensor axes for each sensor, over the last second."""
    mean = {s: x.acc[-round(recording.rate_hz) :].mean(axis=0) for s, x in recording.sensors.items()}
    return {s: x / max(float(np.linalg.norm(x)), 1e-9) for s, x in mean.items()}
