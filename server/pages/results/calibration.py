"""Calibration quality of a trial: all checks of all sensors, with reasons and remedies."""

from __future__ import annotations

import json
from typing import Annotated

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Blobs, Db, Id
from sagittal.server.pages.results.session_context import lead_to_days, read_context
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.report.files.bundle import read_warnings
from sagittal.server.report.view.body_lengths import view_lengths
from sagittal.server.report.view.calibration_checks import view_calibration_checks
from sagittal.server.report.view.sensor_places import view_sensor_places
from sagittal.server.results import analyses

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/sessions/{sid}/calibration")
def show_calibration(
    request: Request, db: Db, blobs: Blobs, sid: Id, user: Annotated[Identity, require(Action.READ_RESULT)]
) -> Response:
    """Body diagram, overall result, and checks of every sensor."""
    with db.read() as c:
        context = read_context(c, sid)
        if elsewhere := lead_to_days(context):
            return elsewhere
        record = analyses.latest(c, sid)
    stored = {} if record is None else json.loads(analyses.file_bytes(blobs, record, "analysis.json"))
    context["analysed"] = record is not None
    context["view"] = view_calibration_checks(
        stored.get("calibration_score"), stored.get("calibration"), read_warnings(stored) if stored else ()
    )
    context["lengths"] = view_lengths(stored.get("body"))
    context["places"] = view_sensor_places(stored.get("sensor_places"))
    record_opening(request, user, "session", sid)
    return render_page(request, db, user, "calibration.html", "patients", **context)
