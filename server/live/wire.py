"""JSON for browsers: live frames, strides, cues and notices, angles in degrees, undefined is null.

Runs in the estimator process; the web process forwards the bytes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import isfinite, pi
from typing import Any, Final

import msgspec
import numpy as np

from sagittal.core.calibration.score import CalibrationScore
from sagittal.core.errors import Notice
from sagittal.core.feedback import Cue, FeedbackState
from sagittal.core.frames import SIDES, SUFFIX, Floats, Side
from sagittal.core.functional_tests.result import GuidedTestView, TimedSegment
from sagittal.core.message import Message
from sagittal.core.online.frame import AngleTrail, CalibrationView, LiveFrame, SensorHealth
from sagittal.core.parameters.live.live_stride import LiveStride
from sagittal.core.parameters.result import Parameter
from sagittal.server.live.messages import BATTERY_WARN_PCT, STALE_S, FigurePose, encode_json
from sagittal.server.report.view.calibration_checks import say_verdict
from sagittal.server.report.view.functional import segment_label
from sagittal.server.report.words.guided_words import tell_person
from sagittal.server.report.words.wording import place_words, reason_words, speak_places

LOST_WARN, LOST_BAD = 0.01, 0.20
"""Fractions of lost samples, as in the assessment of a whole trial (core/quality/assessment.py)."""
SATURATED_WARN: Final = 0.001
"""Fraction of samples at full scale, likewise."""
DOUBTS: Final[Mapping[str, tuple[str, str]]] = {
    "sensors_exchanged": ("bad", "exchanged"),
    "sensor_slipped": ("bad", "slipped"),
    "sensor_late": ("warn", "late"),
    "clocks_disagree": ("warn", "clock in doubt"),
}
"""Inconsistency with the other sensors (core/agreement/live.py) → state and words."""
TEST_PROBLEMS: Final[Mapping[str, str]] = {
    "segments_missing": (
        "This test requires a sensor on the pelvis or chest or, for walking tests, on both feet."
    ),
    "stepped": "The person moved. Stand still again; the time restarts.",
    "trial_too_long": "No end detected within three minutes. Start over.",
}
"""Why a guided test was restarted or cannot start (core/functional_tests/guided.py)."""
CURVE_POINTS: Final = 51
"""Every second of the 101 points of a cycle, which suffices for a chart on a tablet."""

_SEVERITY: Final = {"info": "info", "warning": "warn", "error": "bad"}
_DEGREES: Final = 180.0 / pi


def frame(
    live_frame: LiveFrame,
    trail: Iterable[AngleTrail],
    slow: Mapping[str, Any],
    phase: Mapping[Side, float | None],
) -> bytes:
    """A frame with the angles since the last one sent, without the closing brace.

    Parameters
    ----------
    trail : angles of this frame and earlier unsent ones. slow : its `slow_part`, or an earlier one.
    phase : percentage of the current cycle per side, 0 to 100, None if unknown.
    """
    body = {
        "type": "frame",
        "t": _number(live_frame.t_s, 3),
        "stage": live_frame.stage,
        "method": live_frame.method,
        "angles_deg": {name: _number(value * _DEGREES, 2) for name, value in live_frame.angles.items()},
        "trace": _trace(trail),
        "phase": {SUFFIX[side]: _number(phase.get(side), 1) for side in SIDES},
        "contact": {SUFFIX[side]: bool(live_frame.contact.get(side, False)) for side in SIDES},
        **slow,
    }
    return encode_json(body)[:-1]


def slow_part(
    live_frame: LiveFrame,
    battery: Mapping[str, float],
    guided: GuidedTestView | None = None,
    calibration: msgspec.Raw | None = None,
) -> dict[str, Any]:
    """Parts of a frame that change slowly and are reused: calibration, sensors, test.

    Parameters
    ----------
    calibration : result of `describe_calibration`, if available.
    """
    health = [_health(row, battery.get(row.id)) for row in live_frame.health]
    return {
        "test": msgspec.Raw(encode_json(None if guided is None else tell_test(guided))),
        "calibration": calibration or describe_calibration(live_frame.calibration),
        "health": msgspec.Raw(encode_json(health)),
    }


def describe_calibration(view: CalibrationView | None) -> msgspec.Raw:
    """State of the calibration."""
    return msgspec.Raw(encode_json(_calibration(view)))


def tell_test(view: GuidedTestView) -> dict[str, Any]:
    """State of a functional test, with results in units of the catalogue."""
    result = view.result
    return {
        "phase": view.phase,
        "say": tell_person(view.protocol, view.phase),
        "t": _number(view.t_s, 2),
        "start_s": _number(view.start_s, 3),
        "end_s": _number(view.end_s, 3),
        "rises": view.rises,
        "seconds": view.seconds,
        "final": view.final,
        "problem": None if view.problem is None else TEST_PROBLEMS[view.problem],
        "corrected": result is not None and result.corrected,
        "figures": [] if result is None else [_figure(p) for p in result.parameters],
        "segments": [] if result is None else [_segment(s) for s in result.segments],
    }


def _figure(p: Parameter) -> dict[str, Any]:
    return {
        "name": p.name,
        "value": _number(p.mean, 4),
        "plus_minus": _number(p.uncertainty, 4),
        "reason": None if p.mean is not None else reason_words(p.reason),
    }


def _segment(part: TimedSegment) -> dict[str, Any]:
    return {
        "label": segment_label(part.name),
        "start_s": _number(part.start_s, 3),
        "duration_s": _number(part.duration_s, 3),
    }


def pose(live_frame: LiveFrame) -> FigurePose | None:
    """Pose of the avatar in a frame, None if unavailable."""
    segments = [name for name in live_frame.q if name in live_frame.p]
    if not segments:
        return None
    return FigurePose(
        list(segments),
        np.array([live_frame.q[s] for s in segments], np.float32).tobytes(),
        np.array([live_frame.p[s] for s in segments], np.float32).tobytes(),
        live_frame.valid,
        {side: bool(on) for side, on in live_frame.contact.items()},
    )


def stride(live_stride: LiveStride) -> dict[str, Any]:
    """A stride; sent again with the same `n` when its end is refined or its distances become available."""
    duration = live_stride.end_s - live_stride.start_s
    off = (
        None
        if live_stride.foot_off_s is None
        else 100.0 * (live_stride.foot_off_s - live_stride.start_s) / duration
    )
    return {
        "type": "stride",
        "n": live_stride.n,
        "side": live_stride.side,
        "start_s": _number(live_stride.start_s, 4),
        "end_s": _number(live_stride.end_s, 4),
        "detected_s": _number(live_stride.detected_s, 4),
        "foot_off_pct": _number(off, 2),
        "values": {name: _number(value, 5) for name, value in live_stride.values.items()},
        "reasons": dict(live_stride.reasons),
        "curves_deg": _curves(live_stride.curves),
        "flags": list(live_stride.flags),
        "counted": live_stride.counted,
        "complete": live_stride.complete,
    }


def cue(live_cue: Cue) -> dict[str, Any]:
    """Message of a cue for screens."""
    return {"type": "cue", **live_cue.to_json()}


def feedback(state: FeedbackState) -> dict[str, Any]:
    """State of the feedback."""
    return {"type": "feedback", **state.to_json()}


def announce_calibration(live_frame: LiveFrame) -> dict[str, Any]:
    """Message that calibration has ended, with its outcome."""
    return {
        "type": "calibration",
        "method": live_frame.method,
        "calibration": _calibration(live_frame.calibration),
    }


def notice(live_notice: Notice) -> dict[str, Any]:
    """A notice in the wording of the pages."""
    return {"type": "notice", **_notice(live_notice)}


def _notice(live_notice: Notice) -> dict[str, Any]:
    words = speak_places(live_notice.message)
    return {
        "severity": _SEVERITY[live_notice.severity],
        "text": words,
        "message": words,
        "code": live_notice.code,
        "sensor": live_notice.sensor,
        "t_s": _number(live_notice.t_s, 3),
    }


def judge_calibration(score: CalibrationScore) -> dict[str, Any]:
    """Outcome of a calibration in words: location, reason and remedy of each failed check."""
    rows = [c.to_json() for c in score.checks]
    redo = [
        {
            "place": "" if c.segment is None else place_words(c.segment),
            "title": c.rule.title,
            "why": speak_places(c.why),
            "todo": c.todo,
        }
        for c in score.checks
        if c.verdict == "redo"
    ]
    return {"verdict": score.verdict, "headline": say_verdict(score.verdict, rows), "redo": redo}


def _calibration(view: CalibrationView | None) -> dict[str, Any] | None:
    if view is None:
        return None
    return {
        "stood_s": _number(view.stood_s, 2),
        "walked_s": _number(view.walked_s, 2),
        "steps": view.steps,
        "ok": view.ok,
        "problem": None if view.problem is None else _notice(view.problem),
        "verdict": None if view.score is None else judge_calibration(view.score),
        "checks": [
            {
                "segment": check.segment,
                "still": check.still,
                "method": check.method,
                "score": _number(check.score, 3),
                "notices": [_notice(n) for n in check.notices],
            }
            for check in view.checks
        ],
    }


def _health(row: SensorHealth, battery_pct: float | None) -> dict[str, Any]:
    state, words = _judged(row, battery_pct)
    return {
        "id": row.id,
        "segment": row.segment,
        "rate_hz": _number(row.rate_hz, 1),
        "lost_pct": _number(100.0 * row.lost_share, 2),
        "saturated_pct": _number(100.0 * row.saturated_share, 2),
        "silent_s": _number(row.silent_s, 2),
        "still": row.still,
        "battery_pct": _number(battery_pct, 0),
        "state": state,
        "words": words,
    }


def _judged(row: SensorHealth, battery_pct: float | None) -> tuple[str, str]:
    """State and messages of a sensor, worst first; no messages if it is fine."""
    if row.segment is None:
        return "none", "not used"
    if row.silent_s > STALE_S:
        return "bad", Message(
            "silent for {silent_s:.0f} s", silent_s=row.silent_s
        ) if row.silent_s >= 1.0 else "silent"
    if row.stuck:
        return "bad", "no valid data"
    if row.lost_share > LOST_BAD:
        return "bad", f"{100.0 * row.lost_share:.0f} % lost"
    if row.doubt is not None:
        return DOUBTS[row.doubt]
    if row.lost_share > LOST_WARN:
        return "warn", f"{100.0 * row.lost_share:.0f} % lost"
    if row.saturated_share > SATURATED_WARN:
        return "warn", "saturated"
    if battery_pct is not None and battery_pct < BATTERY_WARN_PCT:
        return "warn", "battery low"
    return "ok", ""


def _trace(trail: Iterable[AngleTrail]) -> dict[str, list[float | None]]:
    pieces = [piece for piece in trail if len(piece.t_s)]
    if not pieces:
        return {"t": []}
    # a new calibration may change the set of angles: earlier curves no longer match
    names = pieces[-1].names
    pieces = [piece for piece in pieces if piece.names == names]
    values = np.concatenate([piece.values for piece in pieces]).T * _DEGREES
    columns = dict(zip(names, _rows(values, 2), strict=True))
    return {"t": _numbers(np.concatenate([piece.t_s for piece in pieces]), 3), **columns}


def _curves(curves: Mapping[str, Floats]) -> dict[str, list[float | None]]:
    if not curves:
        return {}
    whole = np.stack(tuple(curves.values()))
    step = (whole.shape[1] - 1) // (CURVE_POINTS - 1)
    return dict(zip(curves, _rows(whole[:, ::step] * _DEGREES, 2), strict=True))


def _numbers(values: Any, digits: int) -> list[float | None]:
    return _rows(np.asarray(values)[None], digits)[0]


def _rows(values: Floats, digits: int) -> list[list[float | None]]:
    """Rows of an array, rounded; undefined is None."""
    rounded = np.round(values, digits)
    rows: list[list[float | None]] = rounded.tolist()
    if np.isfinite(rounded).all():
        return rows
    return [[v if v is not None and isfinite(v) else None for v in row] for row in rows]


def _number(value: float | None, digits: int) -> float | None:
    return None if value is None or not isfinite(value) else round(float(value), digits)
