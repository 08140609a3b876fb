"""The files an analysis yields, the same for the command line, the worker and the downloads page.

analysis.json   quality, calibration, parameters, warnings, provenance (schema 1)
angles.parquet  joint angles in degrees on the uniform axis
poses.parquet   segment poses for the replay
tracks.parquet  what strides and parameters are measured on (server/report/tracks.py)
signals.parquet what the sensors measured, on the common time axis (server/report/signals.py)
events.csv      contacts: time_s, side, kind (ic | tc), source, confidence (share of detectors),
                uncertainty_s (standard)
steps.csv       steps of a trunk sensor, where no foot carries one: time_s, side
strides.csv     one row per stride with its temporal parameters and why it was left out

Undefined is an empty cell or null, never NaN. `server.report.bundle` reads them back.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Final

import numpy as np

from core.angles import JointAngles
from core.body.health import find_worst_verdict
from core.body.poses import Poses
from core.events.result import GaitEvents, Strides
from core.events.steps import Steps
from core.parameters import cycle_curves
from core.parameters.result import Parameter
from core.parameters.rows import Column
from core.quality import find_shown_level
from core.scores import Scores, score_curves
from server.report import signals, tracks
from server.report.columns import SCHEMA, parquet_file, reduce_to_plain
from server.report.estimator import list_estimated_variables

if TYPE_CHECKING:
    # these packages bring numba, which the web process does without
    from core.calibration.result import Calibration
    from core.pipeline import TakeAnalysis

STRIDE_COLUMNS = ("side", "start_s", "tc_s", "end_s", "opposite_tc_s", "opposite_ic_s", "turn_deg")
"""What a stride is; its parameters, `flags` and `excluded_reason` follow in strides.csv."""


def analysis_files(analysis: TakeAnalysis) -> dict[str, bytes]:
    """Write an analysis as files, name → bytes; a stage that gave nothing leaves its file out."""
    files = {"analysis.json": _json_bytes(summarise_analysis(analysis))}
    if analysis.measured is not None:
        files["events.csv"] = events_csv(analysis.measured.events)
        files["strides.csv"] = strides_csv(analysis.measured.strides, analysis.measured.columns)
        if analysis.measured.steps is not None:
            files["steps.csv"] = steps_csv(analysis.measured.steps)
    if analysis.angles is not None:
        files["angles.parquet"] = angles_parquet(analysis.angles)
    if analysis.poses is not None:
        files["poses.parquet"] = poses_parquet(analysis.poses)
    if analysis.tracks is not None:
        files[tracks.NAME] = tracks.tracks_parquet(analysis.tracks)
    # also where a later stage stopped: who asks why looks at the signals
    files[signals.NAME] = signals.signals_parquet(analysis.recording)
    return files


def summarise_analysis(analysis: TakeAnalysis) -> dict[str, object]:
    """Content of analysis.json (schema 1) as plain JSON values."""
    return {
        "schema": SCHEMA,
        "quality": _quality(analysis),
        "calibration": _calibration(analysis.calibration, analysis.angles),
        "estimator": _estimator(analysis),
        "parameters": [parameter_row(p) for p in analysis.parameters],
        "scores": _scores(analysis),
        "walking": _walking(analysis),
        "warnings": [n.to_json() for n in analysis.notices],
        "provenance": reduce_to_plain(analysis.provenance),
    }


def _quality(analysis: TakeAnalysis) -> dict[str, object]:
    """The quality report; its level is the worse of signals and estimator, `signals_level` the signals'."""
    found = reduce_to_plain(analysis.quality.to_json())
    assert isinstance(found, dict)  # noqa: S101 (narrows the type; `reduce_to_plain` keeps mappings)
    verdict = None if analysis.poses is None else find_worst_verdict(analysis.poses.health)
    level = find_shown_level(analysis.quality.level, verdict)
    reasons = [*analysis.quality.reasons, *([JUDGED[verdict]] if verdict in JUDGED else [])]
    return {**found, "level": level, "signals_level": analysis.quality.level, "reasons": reasons}


JUDGED: Final[Mapping[str | None, str]] = {
    "warn": "The pose estimator doubts part of its result.",
    "bad": "The sensors contradict each other: the pose estimator cannot stand behind its result.",
}
"""Verdict of the estimator → reason of the level."""


def _scores(analysis: TakeAnalysis) -> list[dict[str, object]]:
    """Profiles and indices over several curves, so that a trend over many visits reads no signals."""
    if analysis.angles is None or analysis.measured is None:
        return []
    curves = cycle_curves(analysis.angles, analysis.measured.strides)
    unsure = list_estimated_variables(_estimator(analysis))
    return score_rows(score_curves(curves, analysis.angles.standing_deg, estimated=unsure))


def score_rows(found: Scores) -> list[dict[str, object]]:
    """Profiles and indices as JSON; what belongs to one curve is left out."""
    return [
        {name: reduce_to_plain(value) for name, value in asdict(s).items() if name != "variable"}
        for s in found.scores
        if s.variable is None
    ]


def parameter_row(p: Parameter) -> dict[str, object]:
    """One parameter as JSON; a number that is not finite is null."""
    return {
        "name": p.name,
        "side": p.side,
        "n": p.n,
        "mean": reduce_to_plain(p.mean),
        "sd": reduce_to_plain(p.sd),
        "unit": p.unit,
        "reason": p.reason,
        "cv_pct": reduce_to_plain(p.cv_pct),
        "ci_low": reduce_to_plain(p.ci_low),
        "ci_high": reduce_to_plain(p.ci_high),
        "note": p.note,
        "uncertainty": reduce_to_plain(p.uncertainty),
        "u_own": reduce_to_plain(p.u_own),
        "u_common": reduce_to_plain(p.u_common),
    }


def angles_parquet(angles: JointAngles) -> bytes:
    """Joint angles as Parquet: `t_s` (float64) and `<name>_deg` (float32); lost samples are null."""
    columns = {f"{name}_deg": np.degrees(a).astype(np.float32) for name, a in angles.angles.items()}
    columns |= {f"{s}_heading_deg": np.degrees(a).astype(np.float32) for s, a in angles.headings.items()}
    zero = {name: math.degrees(offset) for name, offset in angles.zero_offset.items()}
    meta: dict[str, object] = {"schema": SCHEMA, "angle_zero": angles.zero, "zero_offset_deg": zero}
    if angles.withheld:
        meta["withheld"] = dict(angles.withheld)
    if angles.bounds:
        meta["bounds_deg"] = {name: math.degrees(bound) for name, bound in angles.bounds.items()}
    if angles.diagnostics.get("estimated"):
        meta["estimated"] = reduce_to_plain(angles.diagnostics["estimated"])
    if angles.standing_deg:
        meta["standing_angles_deg"] = dict(angles.standing_deg)
    return parquet_file(angles.t_s, columns, meta)


def poses_parquet(poses: Poses) -> bytes:
    """Segment poses as Parquet: per segment `<segment>_q_w…z`, `<segment>_p_x…z` (float32), masks (bool)."""
    columns: dict[str, np.ndarray] = {}
    for segment, q in poses.q.items():
        p = poses.p[segment]
        columns |= {f"{segment}_q_{c}": q[:, i].astype(np.float32) for i, c in enumerate("wxyz")}
        columns |= {f"{segment}_p_{c}": p[:, i].astype(np.float32) for i, c in enumerate("xyz")}
    columns["valid"] = poses.valid
    columns |= {f"contact_{segment.removeprefix('foot_')}": c for segment, c in poses.contact.items()}
    body = {name: getattr(poses.body, name) for name in poses.body.__dataclass_fields__}
    meta = {"schema": SCHEMA, "rate_hz": poses.rate_hz, "method": poses.method, "body": body}
    return parquet_file(poses.t_s, columns, meta)


def events_csv(events: GaitEvents) -> bytes:
    """All contacts in order of time."""
    return write_csv(
        ("time_s", "side", "kind", "source", "confidence", "uncertainty_s"),
        ((e.time_s, e.side, e.kind, e.source, e.confidence, e.uncertainty_s) for e in events.events),
    )


def steps_csv(steps: Steps) -> bytes:
    """Steps of a trunk sensor in order of time; the side is empty where it cannot be told."""
    return write_csv(("time_s", "side"), ((s.time_s, s.side) for s in steps.steps))


def strides_csv(strides: Strides, columns: Mapping[str, Column]) -> bytes:
    """Every stride, used or not, with its own parameters and the rules that it meets.

    Parameters
    ----------
    columns : parameters by name, one entry per stride.
    """
    lines = (
        (
            s.side,
            s.start_s,
            s.tc_s,
            s.end_s,
            s.opposite_tc_s,
            s.opposite_ic_s,
            None if s.turn_rad is None else math.degrees(s.turn_rad),
            *(column[i] for column in columns.values()),
            " ".join(s.flags),
            s.excluded_reason,
        )
        for i, s in enumerate(strides.strides)
    )
    return write_csv((*STRIDE_COLUMNS, *columns, "flags", "excluded_reason"), lines)


def write_csv(header: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    """UTF-8 comma-separated text with a header; None and non-finite numbers are empty, numbers to 1e-6."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_cell(v) for v in row] for row in rows)
    return text.getvalue().encode()


def _calibration(calibration: Calibration | None, angles: JointAngles | None) -> dict[str, object] | None:
    if calibration is None:
        return None
    offsets = {} if angles is None else {k: math.degrees(v) for k, v in angles.zero_offset.items()}
    segments = {
        name: {
            "method": s.method,
            "score": s.score,
            "rest_norm_mps2": s.rest_norm,
            "gyro_bias_dps": np.degrees(s.gyro_bias),
            "R_segment_sensor": s.R_segment_sensor,
        }
        for name, s in calibration.segments.items()
    }
    result = reduce_to_plain(
        {
            "method": calibration.method,
            "segments": segments,
            "rest_s": calibration.rest,
            "walking_s": calibration.walking,
            "zero_s": calibration.zero,
            "posture": calibration.posture,
            "angle_zero": None if angles is None else angles.zero,
            "zero_offset_deg": offsets,
            "diagnostics": calibration.diagnostics,
        }
    )
    assert isinstance(result, dict)  # noqa: S101 (narrows the type; `reduce_to_plain` keeps mappings)
    return result


def _walking(analysis: TakeAnalysis) -> dict[str, object] | None:
    """Walking bouts with their stops, and turns."""
    measured = analysis.measured
    if measured is None:
        return None
    return {
        "bouts": [
            {
                "start_s": b.start_s,
                "end_s": b.end_s,
                "contacts": b.contacts,
                "initiation_s": b.initiation_s,
                "stops_s": reduce_to_plain(b.stops),
                "from_rest": b.from_rest,
                "to_rest": b.to_rest,
            }
            for b in measured.bouts
        ],
        "turns": [
            {
                "start_s": t.start_s,
                "end_s": t.end_s,
                "turn_angle_deg": math.degrees(t.angle_rad),
                "turn_duration_s": t.duration_s,
                "turn_peak_velocity_dps": math.degrees(t.peak_rad_s),
                "turn_direction": t.direction,
            }
            for t in measured.turns
        ],
    }


def _estimator(analysis: TakeAnalysis) -> dict[str, object] | None:
    """Which pose estimator ran on what, and its health (docs/estimators.md, "Health")."""
    poses = analysis.poses
    if poses is None:
        return None
    facts = dict(poses.diagnostics)
    feet = analysis.feet
    angles = {} if analysis.angles is None else analysis.angles.diagnostics
    return {
        "name": poses.method,
        "requested": facts.pop("requested", None),
        "reduced": poses.reduced,
        "sensors": reduce_to_plain(facts.pop("sensors", ())),
        "possible": reduce_to_plain(facts.pop("possible", ())),
        "verdict": find_worst_verdict(poses.health),
        "health": [
            {
                "name": f.name,
                "of": f.of,
                "value": reduce_to_plain(f.value),
                "warn": f.warn,
                "bad": f.bad,
                "verdict": f.verdict,
            }
            for f in poses.health
        ],
        "feet": None if feet is None else {"source": feet.source, "linked": feet.linked},
        "estimated_angles": reduce_to_plain(angles.get("estimated", ())),
        "diagnostics": reduce_to_plain(facts),
    }


def _json_bytes(value: object) -> bytes:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, indent=1).encode()


def _cell(value: object) -> object:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return repr(round(value, 6) + 0.0) if math.isfinite(value) else ""
    return "" if value is None else value
