"""Strides and prescriptions for the tests of biofeedback."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from sagittal.core.feedback import Baseline, Cue, FeedbackEngine, Prescription
from sagittal.core.frames import Floats, Side

NAME = "step_length_m"
OPEN = Baseline(mean=0.40, sd=0.03, n=40, session_id="before")
"""Before the take this person's steps were 0.40 m."""


@dataclass(frozen=True)
class Walked:
    """Stride as reported by the live chain."""

    n: int
    side: Side = "left"
    start_s: float = 0.0
    end_s: float = 1.0
    detected_s: float = 1.1
    values: Mapping[str, float | None] = field(default_factory=dict)
    curves: Mapping[str, Floats] = field(default_factory=dict)
    counted: bool = True


def walked(n: int, value: float | None, side: Side = "left", **changes: Any) -> Walked:
    """A stride of a second, the n-th of its side."""
    start = n * 0.5
    result = Walked(n, side, start, start + 1.0, start + 1.1, {NAME: value})
    return replace(result, **changes)


def prescription(**changes: Any) -> Prescription:
    """Steps of 0.60 ± 0.05 m on the left, every stride with feedback, no blocks; `changes` as in its JSON."""
    data: dict[str, Any] = {
        "parameter": NAME,
        "side": "left",
        "target": {"source": "manual", "mean": 0.60, "sd": 0.05},
        "schedule": {"kind": "every", "probe_every": None, "retention_strides": 20},
        "stop_rule": {"max_minutes": None, "gps_rise_deg": None},
    }
    for name, value in changes.items():
        old = data.get(name)
        data[name] = {**old, **value} if isinstance(old, dict) and isinstance(value, dict) else value
    return Prescription.from_json(data)


def train(
    values: Iterable[float], inputs: Prescription | None = None, baseline: Baseline = OPEN
) -> tuple[list[Cue], FeedbackEngine]:
    """Walk with these values of the left side."""
    engine = FeedbackEngine(prescription() if inputs is None else inputs, baseline)
    cues = []
    for n, value in enumerate(values):
        cue = engine.push(walked(2 * n, value))
        if cue is not None:
            cues.append(cue)
    return cues, engine
