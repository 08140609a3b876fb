"""The page on which feedback is prescribed."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from server import prescription_views as views
from server.auth.access import require
from server.auth.identity import Identity
from server.auth.roles import Action
from server.context import Db, Id
from server.services import patients, prescriptions
from server.shell import opened, page

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/patients/{pid}/prescription")
def prescribe(
    request: Request, db: Db, pid: Id, who: Annotated[Identity, require(Action.RUN_LIVE)]
) -> Response:
    """Write a prescription, filled with the one in force."""
    with db.read() as c:
        patient = patients.get(c, pid)
        now = prescriptions.in_force(c, pid)
    opened(request, who, "patient", pid)
    return page(
        request, db, who, "prescription.html", "patients",
        patient=patient, now=now, f=views.starting_point(now, patient.affected_side),
        groups=views.choices(), modes=views.MODES, sources=views.SOURCES,
    )  # fmt: skip
