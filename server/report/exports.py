"""The files an analysis yields, the same for the command line, the worker and the downloads page.

analysis.json   quality, devices, calibration and its score, parameters, warnings, provenance (schema 1)
angles.parquet  joint angles in degrees on the uniform axis
poses.parquet   segment poses for the replay
tracks.parquet  what strides and parameters are measured on (server/report/tracks.py)
signals.parquet what the sensors measured, on the common time axis (server/report/signals.py)
events.csv      contacts: time_s, side, kind (ic | tc), source, confidence (share of detectors),
                uncertainty_s (standard)
steps.csv       steps of a trunk sensor, where no foot carries one: time_s, side
activity…        of daily life, in place of all but the first (server/report/activity_files.py)
repetitions.csv squats of each leg with their measures and why one was left out, of takes of squats
strides.csv     one row per stride with its temporal parameters and why it was left out
repaired.json   the manifest that is proposed where the set-up is wrong (server/services/analysing.py)

Undefined is an empty cell or null, never NaN. `server.report.bundle` reads them back.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Final

import numpy as np

from core.angles import JointAngles
from core.body.health import find_worst_verdict
from core.body.model import LENGTHS
from core.body.poses import Poses
from core.events.result import GaitEvents, Strides
from core.events.steps import Steps
from core.frames import SEGMENTS
from core.parameters import cycle_curves
from core.parameters.catalogue import list_names
from core.parameters.catalogue.entry import SQUAT
from core.parameters.result import Parameter
from core.parameters.rows import Column
from core.quality import concern_paths_alone, find_shown_level
from core.quality.devices import check_device, is_serial
from core.scores import Scores, score_curves
from server.report import signals, tracks
from server.report.activity_files import write_activity
from server.report.columns import SCHEMA, list_turns, parquet_file, reduce_to_plain, write_csv
from server.report.estimator import list_estimated_variables

if TYPE_CHECKING:
    # these packages bring numba, which the web process does without
    from core.calibration.result import Calibration
    from core.pipeline import TakeAnalysis
    from core.squat.measures import SquatSide

MEASURES: Final = list_names(SQUAT, "take")
"""Columns of a squat in repetitions.csv."""

STRIDE_COLUMNS = ("side", "start_s", "tc_s", "end_s", "opposite_tc_s", "opposite_ic_s", "turn_deg")
"""What a stride is; its parameters, `flags` and `excluded_reason` follow in strides.csv."""


def analysis_files(analysis: TakeAnalysis) -> dict[str, bytes]:
    """Write an analysis as files, name → bytes; a stage that gave nothing leaves its file out."""
    if analysis.source.protocol == "activity":
        written = {} if analysis.activity is None else write_activity(analysis.activity)
        return {"analysis.json": _json_bytes(summarise_analysis(analysis)), **written}
    files = {"analysis.json": _json_bytes(summarise_analysis(analysis))}
    if analysis.measured is not None:
        files["events.csv"] = events_csv(analysis.measured.events)
        files["strides.csv"] = strides_csv(analysis.measured.strides, analysis.measured.columns)
        if analysis.measured.steps is not None:
            files["steps.csv"] = steps_csv(analysis.measured.steps)
    if analysis.squats is not None:
        files["repetitions.csv"] = repetitions_csv(analysis.squats)
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
        "devices": _devices(analysis),
        "setup": None if analysis.setup is None else reduce_to_plain(analysis.setup.to_json()),
        "agreement": _agreement(analysis),
        "calibration": _calibration(analysis.calibration, analysis.angles),
        "calibration_score": _score_calibration(analysis),
        "sensor_places": _sensor_places(analysis),
        "body": _body(analysis),
        "estimator": _estimator(analysis),
        "parameters": [parameter_row(p) for p in analysis.parameters],
        "functional": _functional(analysis),
        "scores": _scores(analysis),
        "walking": _walking(analysis),
        "warnings": [n.to_json() for n in analysis.notices],
        "provenance": reduce_to_plain(analysis.provenance),
    }


def _functional(analysis: TakeAnalysis) -> dict[str, object] | None:
    """Start, end and segments of a functional test; None of any other take."""
    test = analysis.functional
    if test is None:
        return None
    return {
        "start_s": test.start_s,
        "end_s": test.end_s,
        "segments": [asdict(s) for s in test.segments],
        "sensor": test.sensor,
        "corrected": test.corrected,
    }


def _quality(analysis: TakeAnalysis) -> dict[str, object]:
    """The quality report; its level is the worse of signals and estimator, `signals_level` the signals'."""
    found = reduce_to_plain(analysis.quality.to_json())
    assert isinstance(found, dict)  # noqa: S101 (narrows the type; `reduce_to_plain` keeps mappings)
    verdict = None if analysis.poses is None else find_worst_verdict(analysis.poses.health)
    level = find_shown_level(analysis.quality.level, verdict)
    bad = [] if analysis.poses is None else [f.name for f in analysis.poses.health if f.verdict == "bad"]
    judged = PATH_JUDGED if concern_paths_alone(bad) else JUDGED.get(verdict)
    reasons = [*analysis.quality.reasons, *([] if judged is None else [judged])]
    return {**found, "level": level, "signals_level": analysis.quality.level, "reasons": reasons}


JUDGED: Final[Mapping[str | None, str]] = {
    "warn": "The pose estimator doubts part of its result.",
    "bad": "The sensors contradict each other: the pose estimator cannot stand behind its result.",
}
"""Verdict of the estimator → reason of the level."""

PATH_JUDGED: Final = (
    "The path of a foot does not fit its rests on the floor: the estimator cannot stand behind its distances."
)
"""The same where nothing but the path of a foot is bad."""


def _devices(analysis: TakeAnalysis) -> list[dict[str, object]]:
    """What each worn device showed of itself, in SI units, and where the analysis took it to be."""
    if analysis.uniform is None:
        return []
    agreed = analysis.agreed
    pairs = () if agreed is None or agreed.exchange is None else agreed.exchange.swap
    swapped = {segment for pair in pairs for segment in pair}
    return [
        {**check_device(stream).to_json(), "segment": segment, "exchanged": segment in swapped}
        for segment, sensor in analysis.recording.sensors.items()
        if is_serial(sensor.device_id)
        and (stream := analysis.source.streams.get(sensor.device_id)) is not None
    ]


CLOCK_DOUBTS: Final = ("feet_out_of_time", "clocks_disagree")
"""Notices that accuse a clock which nothing could put right."""


def _agreement(analysis: TakeAnalysis) -> dict[str, object] | None:
    """What was found of the clock and the place of every sensor, and of whom nothing could be found."""
    agreed = analysis.agreed
    if agreed is None:
        return None
    # a lag that was told names its sensors once; what is below the limits is agreement
    lags = {s: x for x in agreed.lags if x.told for s in x.sensors}
    drifts = {x.sensor: x for x in agreed.drifts}
    slips = {x.segment: x for x in agreed.slips}
    doubted = {n.sensor for n in analysis.notices if n.code in CLOCK_DOUBTS and n.severity != "info"}
    return {
        "exchanged": [] if agreed.exchange is None else [list(pair) for pair in agreed.exchange.swap],
        "sensors": [
            {
                "sensor": s,
                "clock_judged": s in agreed.judged_clocks,
                "lag_ms": 1e3 * lags[s].lag_s if s in lags else None,
                "drift_ms": 1e3 * drifts[s].change_s if s in drifts else None,
                "shifted": s in agreed.shifted_s,
                "clock_doubted": s in doubted,
                "place_judged_s": agreed.judged_places.get(s),
                "slip_deg": math.degrees(slips[s].turn_rad) if s in slips else None,
                "slip_at_s": slips[s].at_s if s in slips else None,
            }
            for s in SEGMENTS
            if s in agreed.recording.sensors
        ],
    }


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
        "estimated": p.estimated,
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


def _body(analysis: TakeAnalysis) -> dict[str, object] | None:
    """Lengths in m and whether each was measured; None where no body was placed."""
    if analysis.mounted is None:
        return None
    body, subject = analysis.mounted.body, analysis.recording.subject
    said = {name: {"m": float(getattr(body, name)), "measured": name in body.measured} for name in LENGTHS}
    return {"height_m": subject.height_m, "leg_m": subject.measures.leg_m, "lengths": said}


def _sensor_places(analysis: TakeAnalysis) -> object:
    """Where sensors sit and joints lie, in cm along the segment's axes, beside the nominal places, and the
    knees' hinges; None where motion was not asked."""
    # readers of results, which have nothing of this to write, do without numba
    from core.agreement.joints import LEG_JOINTS

    arms = None if analysis.mounted is None else analysis.mounted.arms
    if arms is None:
        return None
    return reduce_to_plain(
        {
            "sensors": {
                s: {
                    "guess_cm": 100.0 * x.guess,
                    "cm": 100.0 * x.place,
                    "sd_cm": 100.0 * x.sd,
                    "measured": x.taken,
                }
                for s, x in arms.sensors.items()
            },
            "joints": {
                "-".join(joint): {
                    "joint": LEG_JOINTS[joint],
                    "segment": joint[0],
                    "side": "left" if joint[1].endswith("_l") else "right",
                    "guess_cm": 100.0 * x.guess,
                    "cm": 100.0 * x.centre,
                    "sd_cm": 100.0 * x.sd,
                    "measured": x.asked,
                    "misfit": x.misfit,
                }
                for joint, x in arms.joints.items()
            },
            "knees": {
                side: {
                    "thigh_deg": math.degrees(k.thigh),
                    "thigh_sd_deg": math.degrees(k.thigh_sd),
                    "shank_deg": math.degrees(k.shank),
                    "shank_sd_deg": math.degrees(k.shank_sd),
                }
                for side, k in arms.knees.items()
            },
        }
    )


def events_csv(events: GaitEvents) -> bytes:
    """All contacts in order of time."""
    return write_csv(
        ("time_s", "side", "kind", "source", "confidence", "uncertainty_s"),
        ((e.time_s, e.side, e.kind, e.source, e.confidence, e.uncertainty_s) for e in events.events),
    )


def steps_csv(steps: Steps) -> bytes:
    """Steps of a trunk sensor in order of time; the side is empty where it cannot be told."""
    return write_csv(("time_s", "side"), ((s.time_s, s.side) for s in steps.steps))


def repetitions_csv(squats: Sequence[SquatSide]) -> bytes:
    """Every squat of every leg in order of time, counted or not; measures of those that count."""
    rows: list[tuple[object, ...]] = []
    for leg in squats:
        counted = iter(zip(*(leg.values[name].tolist() for name in leg.values), strict=True))
        for r in leg.repetitions:
            measured = next(counted) if r.excluded is None else ("",) * len(MEASURES)
            rows.append((r.side, r.start_s, r.bottom_s, r.end_s, *measured, r.excluded or ""))
    rows.sort(key=lambda row: row[1:2])
    return write_csv(("side", "start_s", "bottom_s", "end_s", *MEASURES, "excluded_reason"), rows)


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


def _calibration(calibration: Calibration | None, angles: JointAngles | None) -> dict[str, object] | None:
    if calibration is None:
        return None
    offsets = {} if angles is None else {k: math.degrees(v) for k, v in angles.zero_offset.items()}
    segments = {
        name: {
            "method": s.method,
            "score": s.score,
            "forward_sd_deg": None if s.forward_sd is None else math.degrees(s.forward_sd),
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


def _score_calibration(analysis: TakeAnalysis) -> object:
    """Every check of the calibration with its verdict and words; None where it was not reached."""
    score = analysis.calibration_score
    return None if score is None else reduce_to_plain(score.to_json())


def _walking(analysis: TakeAnalysis) -> dict[str, object] | None:
    """What contacts are known to, walking bouts with their stops, and turns."""
    measured = analysis.measured
    if measured is None:
        return None
    return {
        "contact_uncertainty_s": measured.events.contact_uncertainty_s,
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
        "turns": list_turns(measured.turns),
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
