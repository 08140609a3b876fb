"""Content of analysis.json: quality, devices, calibration, parameters, notices, provenance."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.body.health import find_worst_verdict
from sagittal.core.body.model import LENGTHS
from sagittal.core.frames import SEGMENTS, Floats, Side
from sagittal.core.norms.controls import mean_curves
from sagittal.core.norms.scores import CurveMeans, Scores, score_curves
from sagittal.core.parameters.kinematic import read_cycles
from sagittal.core.parameters.result import CycleCurves, Parameter
from sagittal.core.quality import concern_paths_alone, find_shown_level
from sagittal.core.quality.devices import check_device, is_serial
from sagittal.server.report.files.columns import SCHEMA, list_turns, reduce_to_plain
from sagittal.server.report.words.estimator import list_estimated_variables
from sagittal.server.report.words.wording import JUDGED, PATH_JUDGED

if TYPE_CHECKING:
    # these packages import numba, which the web process avoids
    from sagittal.core.pipeline import TakeAnalysis
    from sagittal.core.signals.calibrated import Calibration


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
        **_summarise_curves(analysis),
        "walking": _walking(analysis),
        "warnings": [n.to_json() for n in analysis.notices],
        "provenance": reduce_to_plain(analysis.provenance),
    }


def _functional(analysis: TakeAnalysis) -> dict[str, object] | None:
    """Start, end and segments of a functional test; None for other trials."""
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
    """The quality report; `level` is the worse of signals and estimator, `signals_level` the former."""
    report = reduce_to_plain(analysis.quality.to_json())
    assert isinstance(report, dict)  # noqa: S101 (narrows the type; `reduce_to_plain` keeps mappings)
    verdict = None if analysis.poses is None else find_worst_verdict(analysis.poses.health)
    level = find_shown_level(analysis.quality.level, verdict)
    bad = [] if analysis.poses is None else [f.name for f in analysis.poses.health if f.verdict == "bad"]
    judgement = PATH_JUDGED if concern_paths_alone(bad) else JUDGED.get(verdict)
    reasons = [*analysis.quality.reasons, *([] if judgement is None else [judgement])]
    return {**report, "level": level, "signals_level": analysis.quality.level, "reasons": reasons}


def _devices(analysis: TakeAnalysis) -> list[dict[str, object]]:
    """Checks of each sensor, in SI units, and the segment assigned by the analysis."""
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
"""Notices about uncorrectable clocks."""


def _agreement(analysis: TakeAnalysis) -> dict[str, object] | None:
    """Consistency checks of every sensor's clock and placement, including sensors that could not be
    checked.
    """
    agreed = analysis.agreed
    if agreed is None:
        return None
    # a reported lag names its sensors once; values below the limits are consistent
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


def _summarise_curves(analysis: TakeAnalysis) -> dict[str, object]:
    """Scores and mean curves, so that trends over many visits and control groups need not read angles.

    Profiles and indices cover several curves. Mean curves are side → variable → 101 degrees relative to
    standing, with the precision of angles.parquet. Curves are processed one at a time to limit memory.
    """
    angles, measured = analysis.angles, analysis.measured
    if angles is None or measured is None:
        return {"scores": [], "mean_curves": {}}
    unsure = list_estimated_variables(_estimator(analysis))
    scored, means = CurveMeans(angles.standing_deg), dict[Side, dict[str, object]]()

    def read(cycles: CycleCurves, variable: str, side: Side, rows: Floats) -> None:
        curve = replace(cycles, curves={variable: {side: rows}})
        scored.add(curve)
        for curve_side, own in mean_curves(curve, unsure).items():
            means.setdefault(curve_side, {}).update(
                {v: reduce_to_plain(np.round(c, 5)) for v, c in own.items()}
            )

    cycles = read_cycles(angles, measured.strides, read)
    scores = score_curves(cycles, estimated=unsure, means=scored)
    return {"scores": score_rows(scores), "mean_curves": means}


def score_rows(score_set: Scores) -> list[dict[str, object]]:
    """Profiles and indices as JSON, without scores of single curves."""
    return [
        {name: reduce_to_plain(value) for name, value in vars(s).items() if name != "variable"}
        for s in score_set.scores
        if s.variable is None
    ]


def parameter_row(p: Parameter) -> dict[str, object]:
    """One parameter as JSON; non-finite numbers become null."""
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


def _body(analysis: TakeAnalysis) -> dict[str, object] | None:
    """Segment lengths in m and whether each was measured; None if no body was constructed."""
    if analysis.mounted is None:
        return None
    body, subject = analysis.mounted.body, analysis.recording.subject
    lengths = {name: {"m": float(getattr(body, name)), "measured": name in body.measured} for name in LENGTHS}
    return {"height_m": subject.height_m, "leg_m": subject.measures.leg_m, "lengths": lengths}


def _sensor_places(analysis: TakeAnalysis) -> object:
    """Positions of sensors and joints in cm along the segment's axes, with nominal positions, and the knees'
    hinge axes; None if not estimated from motion.
    """
    # readers of results, which do not need this, avoid numba
    from sagittal.core.agreement.joints import LEG_JOINTS

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
    """All checks of the calibration with result and wording; None if it was not reached."""
    score = analysis.calibration_score
    return None if score is None else reduce_to_plain(score.to_json())


def _walking(analysis: TakeAnalysis) -> dict[str, object] | None:
    """Uncertainty of contacts, walking bouts with their stops, and turns."""
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
    """The pose estimator, its input, and its health (docs/reference/estimators.md, "Health")."""
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
