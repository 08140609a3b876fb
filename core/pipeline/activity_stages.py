"""Stages of a daily-life recording: one trunk sensor, read block by block."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from sagittal.core.activity.monitor import Progress, monitor_activity
from sagittal.core.activity.result import ActivityResult
from sagittal.core.errors import SignalError
from sagittal.core.frames import Segment
from sagittal.core.message import Message
from sagittal.core.pipeline.analysis import TakeAnalysis
from sagittal.core.pipeline.config import PipelineConfig
from sagittal.core.pipeline.stages import PipelineStage
from sagittal.core.quality.assessment import Level, QualityReport
from sagittal.core.signals.recording import Recording, as_long_stream
from sagittal.core.signals.sample_blocks import LongStream

TRUNK: Final[tuple[Segment, ...]] = ("chest", "pelvis")
"""Where the sensor of daily life is worn, the published place first."""

WORN_SHARE: Final = 0.5
"""Of the time that is recorded and worn, postures are known in at least so much, else the take is usable at
best [our choice]."""


def find_trunk_stream(recording: Recording) -> tuple[Segment, LongStream]:
    """The sensor of a daily-life recording; a single unassigned sensor is assumed to be on the chest.

    Raises
    ------
    SignalError : `no_trunk_sensor`.
    """
    by_segment = {s: d for d, s in recording.segments.items() if s is not None}
    available = {**{d: as_long_stream(s) for d, s in recording.streams.items()}, **recording.long}
    for segment in TRUNK:
        if by_segment.get(segment) in available:
            return segment, available[by_segment[segment]]
    if len(available) == 1 and not by_segment:
        return "chest", next(iter(available.values()))
    raise SignalError(
        "no_trunk_sensor",
        Message(
            "Daily-life analysis requires a sensor on the chest or lower back. Assign the sensor that "
            "was worn there (sensors in the recording: {there}).",
            there=", ".join(available),
        ),
    )


def watch_activity(analysis: TakeAnalysis, config: PipelineConfig, tell: Progress) -> TakeAnalysis:
    """Daily-life activities; `tell` reports progress."""
    segment, stream = find_trunk_stream(analysis.source)
    monitored = monitor_activity(stream, segment, analysis.source.subject.height_m, config.activity, tell)
    return replace(analysis, activity=monitored)


def judge_activity(analysis: TakeAnalysis, config: PipelineConfig) -> TakeAnalysis:
    """Quality from the fraction of the recording with known posture; signal errors have stopped it before."""
    monitored = analysis.activity
    if monitored is None:
        level: Level = "poor"
        report = QualityReport(level, ("The sensor provided no usable data.",), 0.0, 0.0, {}, (), ())
        return replace(analysis, report=report)
    reasons = list_doubts(monitored)
    level = "good" if not reasons else "usable" if share_known(monitored) >= WORN_SHARE else "poor"
    notices = tuple(n for n in monitored.notices if n.severity != "info")
    report = QualityReport(level, reasons, monitored.duration_s, monitored.rate_hz, {}, (), notices)
    return replace(analysis, report=report)


def share_known(activity: ActivityResult) -> float:
    """Fraction of the wear time with known posture, 0 to 1."""
    worn_s = sum(s.duration_s for s in activity.spans if s.kind not in ("non_wear", "gap"))
    known_s = sum(s.duration_s for s in activity.spans if s.kind not in ("non_wear", "gap", "unknown"))
    return known_s / worn_s if worn_s > 0.0 else 0.0


def list_doubts(activity: ActivityResult) -> tuple[str, ...]:
    """Why the level is not good, as sentences."""
    doubts: list[str] = []
    total = max(activity.duration_s, 1e-9)
    unknown = 1.0 - share_known(activity)
    if unknown > 0.1:
        doubts.append(
            Message("Posture is unknown for {unknown:.0f} % of the wear time.", unknown=100 * unknown)
        )
    lost = 60.0 * activity.minutes("gap") / total
    if lost > 0.1:
        doubts.append(Message("No data for {lost:.0f} % of the time.", lost=100 * lost))
    if any(n.code in ("no_baseline", "baseline_assumed") for n in activity.notices):
        doubts.append("Without walking, the vertical is uncertain.")
    return tuple(doubts)


ACTIVITY_MONITOR: Final = PipelineStage(
    "activity", 0.0, watch_activity, ("activity",), ("activity",), tells_share=True
)
ACTIVITY_QUALITY: Final = PipelineStage(
    "quality", 0.95, judge_activity, ("report",), ("activity",), runs_after_problem=True
)
