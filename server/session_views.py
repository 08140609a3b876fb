"""What the pages of one session show, as plain values for the templates."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final
from urllib.parse import quote

from sqlalchemy import Connection

from server.page_views import PROTOCOL_NAMES, SEGMENT_NAMES, job_dict, newest_job, who_words
from server.report import level
from server.report.curves import cycle_svg, strip_svg
from server.report.estimator import CHOICES, EstimatorView, estimator_view
from server.report.model import ReportModel
from server.report.panels import CurvePanel
from server.report.table import Row
from server.services import analyses, controls, live, patients, recordings, reports, reviews, sessions
from server.services.patients import Patient
from server.services.sessions import Session
from server.storage.blobs import BlobStore
from web.words import day, seconds

COLUMNS: Final = 3
"""Charts per row: sagittal, frontal, transverse."""

PAGE_HEIGHTS: Final = {False: 144, True: 158}
PAPER_HEIGHTS: Final = {False: 124, True: 138}
KEY_HEIGHT: Final = 186
"""Chart heights in px; the last row also carries the unit of the x axis."""

SEVERITIES: Final = ("bad", "warn", "info")

NO_STRIDE_CODES: Final = ("foot_missing", "no_strides", "few_steps")
"""Notices that explain a take without strides."""

SECONDARY: Final = (
    "Parts of stance and swing",
    "Walking and turning",
    "Regularity of the trunk",
    "Support in seconds",
)
"""Groups for those who look closer: folded on the page, not on paper."""

NOT_ON_PAPER: Final = ("swing_pct", "swing_time_s", "turning_angle_deg")
"""What the rest of a stride leaves, and what a straight walk has none of."""

SHOWN: Final = (
    "problem",
    "quality",
    "kpis",
    "strides",
    "duration_s",
    "norm_note",
    "norm_source",
    "curve_notes",
    "used",
    "replay",
    "condition",
    "profile",
    "limits",
)
"""Members of ReportModel that templates use as they are."""

STAGE_NAMES: Final[Mapping[str, str]] = {
    "reading": "Read the files",
    "timeline": "Lay all sensors on one time axis",
    "quality": "Check the data",
    "calibration": "Calibrate: how each sensor sits on its segment",
    "orientation": "Find the orientation of each segment",
    "events": "Find contacts and strides",
    "poses": "Build the figure",
    "angles": "Compute joint angles",
    "parameters": "Compute parameters",
}
"""Stages of an analysis in order → what each does, in words; core.pipeline itself takes seconds to import."""

FILE_WORDS: Final[Mapping[str, str]] = {
    "analysis.json": "Quality, calibration, parameters, warnings, provenance",
    "angles.parquet": "Joint angles in degrees over time",
    "poses.parquet": "Orientation and position of every segment over time",
    "tracks.parquet": "Paths of the feet and what else strides are measured on",
    "signals.parquet": "What the sensors measured, on one time axis",
    "events.csv": "Contacts and foot-offs as detected",
    "strides.csv": "Every stride with its parameters, and why it was left out",
}


def base(c: Connection, session_id: str) -> dict[str, Any]:
    """Session, patient, recording and the newest job: what every page of a session needs."""
    session = sessions.get(c, session_id)
    patient = patients.get(c, session.patient_id)
    job = newest_job(c, session_id)
    take = live.current(c, session_id)
    return {
        "session": session,
        "patient": patient,
        "controls": controls.visits(c, patient, session),
        "recording": session.state != "empty",
        "job": None if job is None else job_dict(job),
        "stages": list(STAGE_NAMES.items()),
        "live_now": take.state if take is not None and take.is_open else None,
        "damages": live.damages(c, session_id),
        "report": None,
    }


def downloads(c: Connection, blobs: BlobStore, session_id: str, *, results: bool) -> dict[str, Any]:
    """Files to download, estimator, provenance and the mapping behind the shown analysis."""
    this = recordings.current(c, session_id)
    found = analyses.of_session(c, session_id) if results else []
    shown = found[0] if found else None
    files = [] if shown is None else [(shown.id, name, blob.size) for name, blob in shown.files.items()]
    return {
        "analysis": shown,
        "estimator": None if shown is None else _estimator(blobs, shown),
        "earlier": [
            {"id": a.id, "created_at": a.created_at, "estimator": _asked_for(a.config)} for a in found[1:]
        ],
        "results": [
            {
                "name": name,
                "what": FILE_WORDS.get(name, ""),
                "size": size,
                "href": f"/api/v1/analyses/{analysis_id}/files/{quote(name)}",
            }
            for analysis_id, name, size in files
        ],
        "originals": [
            {**vars(f), "href": f"/api/v1/sessions/{session_id}/files/{quote(f.name)}" if results else None}
            for f in (this.files if this else ())
        ],
        "provenance": _provenance(shown) if shown else [],
        "mapping": _mapping(shown.manifest if shown else None),
    }


def _estimator(blobs: BlobStore, shown: analyses.Analysis) -> EstimatorView | None:
    return estimator_view(json.loads(analyses.file_bytes(blobs, shown, "analysis.json")).get("estimator"))


def _asked_for(config: Mapping[str, Any]) -> str | None:
    """The estimator somebody chose by name."""
    asked = (config.get("poses") or {}).get("estimator")
    return None if asked is None else CHOICES.get(asked, asked)


def _provenance(shown: analyses.Analysis) -> list[tuple[str, str]]:
    return [
        ("Input sha256", shown.input_sha256),
        ("Settings sha256", shown.config_sha256),
        ("Version", shown.code_version),
        ("Analysis", shown.id),
    ]


def _mapping(manifest: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    sensors = (manifest or {}).get("sensors") or {}
    return [(device, SEGMENT_NAMES.get(segment, "not used")) for device, segment in sensors.items()]


def report(
    blobs: BlobStore,
    found: analyses.Analysis,
    edits: reviews.Edits,
    context: Mapping[str, Any],
    *,
    paper: bool,
) -> dict[str, Any]:
    """The report of an analysis with its charts drawn, for the page or for paper."""
    patient, session = context["patient"], context["session"]
    bundle, model = reports.read(
        blobs, found, edits, patient, session, context.get("before"), context["controls"]
    )
    last_row = len(model.panels) - COLUMNS
    heights = PAPER_HEIGHTS if paper else PAGE_HEIGHTS
    curves = [_chart(p, heights[i >= last_row], x_unit=i >= last_row) for i, p in enumerate(model.panels)]
    used, total = sum(model.used.values()), len(model.strides)
    return {
        **{name: getattr(model, name) for name in SHOWN},
        "groups": _groups(model, paper=paper),
        "since": None if paper else model.since,
        "not_compared": _not_compared(session, model),
        "more": [(name, rows) for name, rows in model.groups if name in SECONDARY],
        "missing": [
            (r.title, r.reason.removeprefix("not measured: "))
            for name, rows in model.groups
            for r in rows
            if r.reason and name not in SECONDARY
        ],
        "warnings": _notices(model),
        "curves": curves,
        "key_curve": _chart(model.key_curve, KEY_HEIGHT, x_unit=True),
        "strip": strip_svg(bundle.strides, model.duration_s) if model.strides else "",
        "stride_words": f"{used} of {total} used",
        "empty_reason": _why_empty(model),
        "identity": _identity(patient, session, model.condition),
        "provenance_line": f"Sagittal {found.code_version} · settings {found.config_sha256[:8]} · "
        f"input {found.input_sha256[:8]} · {day(found.created_at)}",
        "has_poses": "poses.parquet" in found.files,
    }


def numbers(
    blobs: BlobStore, found: analyses.Analysis, edits: reviews.Edits, context: Mapping[str, Any]
) -> dict[str, Any]:
    """What of the report stands beside the timeline and changes with every edit."""
    _, model = reports.read(
        blobs, found, edits, context["patient"], context["session"], None, context["controls"]
    )
    return {
        "groups": _groups(model, paper=False),
        "norm_note": model.norm_note,
        "key_curve": _chart(model.key_curve, KEY_HEIGHT, x_unit=True),
        "used": model.used,
        "norm_source": model.norm_source,
        "stride_words": f"{sum(model.used.values())} of {len(model.strides)} used",
        "replay": {**model.replay, "curves": {}},
        "empty_reason": _why_empty(model),
    }


def _groups(model: ReportModel, *, paper: bool) -> list[tuple[str, tuple[Row, ...]]]:
    """The parameter table; empty when not one number was found, because then one sentence says more.

    On paper only what was measured has a row; `missing` says the rest in one line.
    """
    groups = [(name, rows) for name, rows in model.groups if name not in SECONDARY]
    if all(row.reason for _, rows in groups for row in rows):
        return []
    if not paper:
        return groups
    # a level from the anatomical zero says more than the same one from standing
    known = {level.from_standing(r.name) for name, rows in groups if name == level.GROUP for r in rows}
    left_out = {*NOT_ON_PAPER, *known}
    short = (
        (name, tuple(r for r in rows if r.reason is None and r.name not in left_out)) for name, rows in groups
    )
    return [(name, rows) for name, rows in short if rows]


def _why_empty(model: ReportModel) -> str:
    causes = [w.message for code in NO_STRIDE_CODES for w in model.warnings if w.code == code]
    read = f"{seconds(model.duration_s)} of data were read, but no complete stride was seen in them."
    asked = "Is a sensor on each foot, and is it the one the mapping says?"
    return model.problem or " ".join([read, *(causes or [asked])])


def _notices(model: ReportModel) -> list[dict[str, Any]]:
    """Notices by severity; those of one kind share a box, what stopped the analysis has its own place."""
    boxes: dict[tuple[str, str], dict[str, Any]] = {}
    for w in sorted(model.warnings, key=lambda w: SEVERITIES.index(w.kind)):
        if w.message == model.problem:
            continue
        box = boxes.setdefault((w.kind, w.code), {"kind": w.kind, "title": w.title, "messages": []})
        if box["messages"]:
            box["title"] = w.code.replace("_", " ").capitalize()
        box["messages"].append(w.message)
    return list(boxes.values())


def chart_view(panel: CurvePanel, svg: str) -> dict[str, Any]:
    """A drawn panel with its captions."""
    return {
        "name": panel.variable.name,
        "title": panel.variable.label,
        "zero": panel.title.removeprefix(panel.variable.label).lstrip(", "),
        "low": panel.low_confidence,
        "reason": panel.reason,
        "svg": svg,
    }


def _chart(panel: CurvePanel, height: int, *, x_unit: bool) -> dict[str, Any]:
    return chart_view(panel, cycle_svg(panel, height=height, x_unit=x_unit))


def _not_compared(session: Session, model: ReportModel) -> str | None:
    """Why the table has no column of change, None where it has."""
    if model.since is not None:
        return None
    if session.feedback:
        return "Walked with feedback: shown, not compared with other visits."
    return f"No earlier visit in this condition to compare with: {model.condition}."


def _identity(patient: Patient, session: Session, condition: str) -> list[tuple[str, str]]:
    height = session.height_m or patient.height_m
    return [
        ("Code", patient.code),
        ("Age, sex", who_words(patient.sex, patient.birth_year) or "not given"),
        ("Height", f"{height:.2f} m" if height else "not given"),
        ("Protocol", PROTOCOL_NAMES.get(session.protocol, session.protocol)),
        ("Walked", condition),
        ("Date", day(session.performed_on)),
    ]
