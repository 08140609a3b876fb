"""Exports of a visit for other programs: list and request; downloads are files of the analysis."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, sessions
from sagittal.server.context import Db, Id, OpenTrail, Queue
from sagittal.server.downloads import exports
from sagittal.server.export.kinds import ExportName
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.jobs.queue import JobView
from sagittal.server.results import analyses

router = APIRouter(route_class=StrictJsonRoute, tags=["exports"])
Reader = Annotated[Identity, require(Action.READ_RESULT)]


class ExportNew(schemas.Request):
    """The requested format."""

    kind: Annotated[ExportName, Field(description="as docs/reference/exports.md names them")]


@router.post(
    "/sessions/{session_id}/exports", status_code=202, response_model=JobView, responses=refusals(404, 409)
)
def start(session_id: Id, body: ExportNew, db: Db, queue: Queue, user: Reader) -> JobView:
    """Export the displayed analysis with its current edits; repeated requests return the same export."""
    with db.write() as c:
        return exports.submit(c, queue, user, session_id, kind=body.kind)


@router.get("/sessions/{session_id}/exports", response_model=list[exports.ExportOffer])
def list_exports(session_id: Id, db: Db, trail: OpenTrail, user: Reader) -> list[exports.ExportOffer]:
    """List export formats of the displayed analysis; one with a `file` can be downloaded with its files."""
    with db.read() as c:
        record = analyses.get_shown(c, session_id)
        session, patient = sessions.get(c, session_id), patients.get(c, record.patient_id)
        offers = exports.list_offers(c, patient, session, record)
    trail.record_watched(user, "exports.opened", "session", session_id)
    return offers
