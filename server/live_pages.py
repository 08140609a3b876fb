"""The live pages: the therapist's screen and the patient's; what moves on them comes by the feed."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from server import live_views
from server.auth.access import require
from server.auth.identity import Identity
from server.auth.roles import Action
from server.context import Db, Id
from server.services import patients, sessions
from server.shell import opened, page

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
Therapist = Annotated[Identity, require(Action.RUN_LIVE)]


@router.get("/sessions/{sid}/live")
def live(request: Request, db: Db, sid: Id, who: Therapist) -> Response:
    """Pair the tablet, calibrate, watch the walk and steer the feedback."""
    with db.read() as c:
        session = sessions.get(c, sid)
        patient = patients.get(c, session.patient_id)
        view = live_views.live_view(c, session, patient, capture=str(request.base_url) + "capture")
    opened(request, who, "session", sid)
    return page(request, db, who, "live.html", "patients", session=session, patient=patient, **view)


@router.get("/sessions/{sid}/live/patient")
def patient_screen(request: Request, db: Db, sid: Id, who: Therapist) -> Response:
    """One target and one picture, for the person who walks."""
    with db.read() as c:
        session = sessions.get(c, sid)
        patient = patients.get(c, session.patient_id)
        view = live_views.patient_view(c, session)
    opened(request, who, "session", sid)
    return page(request, db, who, "live-patient.html", "patients", session=session, patient=patient, **view)
