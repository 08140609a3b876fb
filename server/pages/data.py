"""Downloads, the health of the estimator, provenance, running again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Final
from urllib.parse import quote

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.responses import Response

from server.auth.access import require
from server.auth.identity import Identity
from server.auth.roles import Action
from server.context import Blobs, Db, Id
from server.pages.session_context import read_context
from server.pages.shell import record_opening, render_page
from server.pages.words import SEGMENT_NAMES
from server.report.estimator import EstimatorView, choice_label, estimator_view
from server.services import analyses, recordings
from server.storage.blobs import BlobStore

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

FILE_WORDS: Final[Mapping[str, str]] = {
    "analysis.json": "Quality, calibration, parameters, warnings, provenance",
    "angles.parquet": "Joint angles in degrees over time",
    "poses.parquet": "Orientation and position of every segment over time",
    "tracks.parquet": "Paths of the feet and what else strides are measured on",
    "signals.parquet": "What the sensors measured, on one time axis",
    "events.csv": "Contacts and foot-offs as detected",
    "strides.csv": "Every stride with its parameters, and why it was left out",
}


@router.get("/sessions/{sid}/data")
def show_data(
    request: Request, db: Db, blobs: Blobs, sid: Id, who: Annotated[Identity, require(Action.READ_SESSION)]
) -> Response:
    """Downloads, the estimator's health, provenance, running again."""
    with db.read() as c:
        context = read_context(c, sid)
        context |= list_downloads(c, blobs, sid, results=who.may(Action.READ_RESULT))
    record_opening(request, who, "session", sid)
    return render_page(request, db, who, "data.html", "patients", **context)


def list_downloads(c: Connection, blobs: BlobStore, session_id: str, *, results: bool) -> dict[str, Any]:
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


def _estimator(blobs: BlobStore, shown: analyses.AnalysisRecord) -> EstimatorView | None:
    return estimator_view(json.loads(analyses.file_bytes(blobs, shown, "analysis.json")).get("estimator"))


def _asked_for(config: Mapping[str, Any]) -> str | None:
    """The estimator somebody chose by name."""
    asked = (config.get("poses") or {}).get("estimator")
    return None if asked is None else choice_label(asked)


def _provenance(shown: analyses.AnalysisRecord) -> list[tuple[str, str]]:
    return [
        ("Input sha256", shown.input_sha256),
        ("Settings sha256", shown.config_sha256),
        ("Version", shown.code_version),
        ("Analysis", shown.id),
    ]


def _mapping(manifest: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    sensors = (manifest or {}).get("sensors") or {}
    return [(device, SEGMENT_NAMES.get(segment, "not used")) for device, segment in sensors.items()]
