"""Daily-life recording with known activity in every minute, as monitor result and as files."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from sagittal.core.activity.result import (
    ActivityBout,
    ActivityKind,
    ActivityResult,
    ActivitySpan,
    PosturalTransition,
    TransitionCandidate,
    WearPeriod,
)
from sagittal.core.activity.totals import sum_days, sum_hours
from sagittal.core.frames import Floats
from sagittal.core.pipeline import TakeAnalysis
from sagittal.core.quality import QualityReport
from sagittal.core.signals.recording import Recording
from sagittal.server.report.files.exports import analysis_files

STARTED: Final = dt.datetime.fromisoformat("2026-11-16T18:00:00")
"""A Monday at six in the evening."""

CADENCE: Final = 100.0

DAY: Final[tuple[tuple[ActivityKind, float], ...]] = (
    ("standing", 1.0),
    ("sitting", 3.0),
    ("walking", 0.1),
    ("lying", 8.0),
    ("sitting", 0.4),
    ("walking", 0.005),
    ("sitting", 0.995),
    ("unknown", 0.5),
    ("non_wear", 1.0),
    ("stairs_up", 0.01),
    ("standing", 4.99),
    ("walking", 0.5),
    ("sitting", 3.5),
)
"""From six to six, h: 8 lying, 7.895 sitting, 5.99 standing, 0.615 walking, 0.5 unknown, 1 not worn."""

LEAN: Final = {"lying": -88.0, "sitting": 6.0, "standing": 1.0, "walking": 3.0, "stairs_up": 12.0}


def live(days: float = 2.0, *, clock: bool = True, height_m: float = 1.75) -> ActivityResult:
    """So many days of DAY, with a clock from STARTED on."""
    spans: list[ActivitySpan] = []
    position, end = 0.0, days * 86400.0
    while position < end:
        for kind, hours in DAY:
            upto = min(position + hours * 3600.0, end)
            if upto > position:
                spans.append(ActivitySpan(position, upto, kind, 1.0, "both_ends"))
            position = upto
    bouts = tuple(_walk(s) for s in spans if s.kind in ("walking", "stairs_up"))
    steps: Floats = np.concatenate([np.linspace(b.start_s, b.end_s, b.steps) for b in bouts] or [np.empty(0)])
    seats = [s for s in spans if s.kind in ("sitting", "standing") and s.end_s < end]
    transitions = tuple(_rise(s.end_s) if s.kind == "sitting" else _sit(s.end_s) for s in seats)
    candidate = TransitionCandidate(3000.0, 2999.0, 3001.0, 15.0, 0.38, "lean_below_limit", "sit_to_stand")
    started = STARTED if clock else None
    seconds = np.full(int(end), np.nan)
    for s in spans:
        seconds[int(s.start_s) : int(s.end_s)] = LEAN.get(s.kind, np.nan)
    return ActivityResult(
        segment="chest",
        device_id="AX1",
        source="day.cwa",
        rate_hz=50.0,
        has_gyro=False,
        started_at=started,
        duration_s=end,
        height_m=height_m,
        spans=tuple(spans),
        transitions=transitions,
        candidates=(candidate,),
        bouts=bouts,
        steps_s=steps,
        turns=(),
        hours=sum_hours(end, started, spans, steps),
        days=sum_days(end, started, spans, steps, bouts, transitions),
        periods=(WearPeriod(0.0, end, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), "walking", 4),),
        inclination_deg=seconds,
    )


def files(result: ActivityResult) -> Mapping[str, bytes]:
    """The files that a worker stores of it."""
    report = QualityReport("good", (), result.duration_s, result.rate_hz, MappingProxyType({}), (), ())
    source = Recording({}, {}, protocol="activity", sha256={"day.cwa": "ff"})
    return analysis_files(TakeAnalysis(source=source, version="1", report=report, activity=result))


def _walk(s: ActivitySpan) -> ActivityBout:
    steps = round(s.duration_s * CADENCE / 60.0)
    if s.kind == "stairs_up":
        return ActivityBout(s.start_s, s.end_s, "stairs_up", steps, steps, 0, CADENCE)
    return ActivityBout(s.start_s, s.end_s, "walking", steps, 0, 0, CADENCE)


def _rise(at_s: float) -> PosturalTransition:
    return PosturalTransition("sit_to_stand", at_s, at_s - 1.0, at_s + 1.0, 36.0, 0.4)


def _sit(at_s: float) -> PosturalTransition:
    return PosturalTransition("stand_to_sit", at_s, at_s - 1.0, at_s + 1.0, 36.0, -0.4)
