"""Downloads, state of the estimator, provenance, and repeated analysis."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Final
from urllib.parse import quote

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Blobs, Db, Id
from sagittal.server.downloads import exports
from sagittal.server.export.kinds import EXPORTED
from sagittal.server.pages.job_views import follow_few, view_job
from sagittal.server.pages.results.session_context import read_context
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.pages.words import SEGMENT_NAMES
from sagittal.server.report.view.sensor_checks import sensor_checks
from sagittal.server.report.words.estimator import choice_label, estimator_view
from sagittal.server.results import analyses, repairs
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.uploads import recordings, videos

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

FILE_WORDS: Final[Mapping[str, str]] = {
    "analysis.json": "Quality, calibration, parameters, warnings, provenance",
    "angles.parquet": "Joint angles in degrees over time",
    "poses.parquet": "Orientation and position of every segment over time",
    "tracks.parquet": "Foot trajectories and other stride-level data",
    "repaired.json": "The proposed replacement set-up",
    "signals.parquet": "Sensor signals on a common time axis",
    "events.csv": "Detected contacts and foot-offs",
    "steps.csv": "Steps from the trunk sensor, if there is no foot sensor",
    "repetitions.csv": "All squats with their measures and any reason for exclusion",
    "activity.json": "Daily life: days, hours, transitions, walking bouts and wear time",
    "activity_spans.parquet": "Activities with start and end times",
    "activity_spans.csv": "The same as text",
    "activity_inclination.parquet": "Inclination of the trunk in degrees, once a second",
    "activity_steps.parquet": "Time of every step of daily life",
    "activity_hours.csv": "Steps and minutes of each posture in every hour",
    "transitions.csv": "Postural transitions, and rejected trunk leans with the reason",
    "walking_bouts.csv": "All walking bouts of daily life with steps and cadence",
    "strides.csv": "All strides with their parameters and any reason for exclusion",
}


@router.get("/sessions/{sid}/data")
def show_data(
    request: Request, db: Db, blobs: Blobs, sid: Id, user: Annotated[Identity, require(Action.READ_SESSION)]
) -> Response:
    """Downloads, state of the estimator, provenance, and repeated analysis."""
    with db.read() as c:
        context = read_context(c, sid)
        context |= list_downloads(c, blobs, sid, results=user.may(Action.READ_RESULT))
        context["exports"] = _list_exports(c, context)
        with_video = user.may(Action.READ_RESULT) and context["session"].has_video
        context["video"] = videos.find(c, sid) if with_video else None
    record_opening(request, user, "session", sid)
    return render_page(request, db, user, "data.html", "patients", **context)


def list_downloads(c: Connection, blobs: BlobStore, session_id: str, *, results: bool) -> dict[str, Any]:
    """Template context: files, estimator, sensor checks, provenance and mapping of the displayed analysis."""
    this = recordings.current(c, session_id)
    records = analyses.of_session(c, session_id) if results else []
    record = records[0] if records else None
    stored = {} if record is None else json.loads(analyses.file_bytes(blobs, record, "analysis.json"))
    files = [] if record is None else [(record.id, name, blob.size) for name, blob in record.files.items()]
    return {
        "analysis": record,
        "files_changed": record is not None and this is not None and record.recording_id != this.id,
        "archive": None if record is None else f"/api/v1/sessions/{session_id}/archive.zip",
        "estimator": estimator_view(stored.get("estimator")),
        "sensors": sensor_checks(stored.get("agreement")),
        "earlier": [
            {
                "id": a.id,
                "created_at": a.created_at,
                "estimator": _asked_for(a.config),
                "again": _ask_again(this, record, a),
            }
            for a in records[1:]
        ],
        "results": [
            {
                "name": name,
                "what": _describe_file(name),
                "size": size,
                "href": f"/api/v1/analyses/{analysis_id}/files/{quote(name)}",
            }
            for analysis_id, name, size in files
            if not name.startswith(EXPORTED)
        ],
        "originals": [
            {**vars(f), "href": f"/api/v1/sessions/{session_id}/files/{quote(f.name)}" if results else None}
            for f in (this.files if this else ())
        ],
        "provenance": _provenance(record) if record else [],
        "mapping": _mapping(record.manifest if record else None),
    }


def _list_exports(c: Connection, context: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Export formats: available, in progress, or to be requested; none without an analysis."""
    record = context["analysis"]
    if record is None:
        return []
    offers = exports.list_offers(c, context["patient"], context["session"], record)
    views = [
        {
            **vars(offer),
            "job": None if offer.job is None else view_job(offer.job),
            "href": offer.file and f"/api/v1/analyses/{offer.analysis_id}/files/{quote(offer.file)}",
        }
        for offer in offers
    ]
    follow_few([offer["job"] for offer in views])
    return views


def _describe_file(name: str) -> str:
    if name.startswith("sensitivity-"):
        return "Sensitivity of squat angles to each input"
    return FILE_WORDS.get(name, "")


def _ask_again(
    this: recordings.StoredRecording | None,
    record: analyses.AnalysisRecord | None,
    earlier: analyses.AnalysisRecord,
) -> dict[str, Any] | None:
    """Request for restoring an earlier setup of the same files; None if it is that of the displayed
    analysis.
    """
    if this is None or record is None or earlier.recording_id != this.id:
        return None
    if repairs.take_setup(None, earlier.manifest) == repairs.take_setup(None, record.manifest):
        return None
    return {
        "manifest": repairs.take_setup(this.manifest, earlier.manifest),
        "config": dict(earlier.config),
    }


def _asked_for(config: Mapping[str, Any]) -> str | None:
    """Label of the estimator chosen by the user, None if automatic."""
    name = (config.get("poses") or {}).get("estimator")
    return None if name is None else choice_label(name)


def _provenance(record: analyses.AnalysisRecord) -> list[tuple[str, str]]:
    return [
        ("Input sha256", record.input_sha256),
        ("Settings sha256", record.config_sha256),
        ("Version", record.code_version),
        ("Analysis", record.id),
    ]


def _mapping(manifest: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    sensors = (manifest or {}).get("sensors") or {}
    return [(device, SEGMENT_NAMES.get(segment, "not used")) for device, segment in sensors.items()]
