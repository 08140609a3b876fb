"""Training programmes: visits planned for a patient, and the sessions held."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, programmes
from sagittal.server.context import Db, Id, OpenTrail
from sagittal.server.http.json_body import StrictJsonRoute

router = APIRouter(route_class=StrictJsonRoute, tags=["programmes"])
Planner = Annotated[Identity, require(Action.WRITE_SESSION)]


@router.get("/patients/{patient_id}/programmes", response_model=list[programmes.Programme])
def list_programmes(
    patient_id: Id, db: Db, trail: OpenTrail, user: Annotated[Identity, require(Action.READ_SESSION)]
) -> list[programmes.Programme]:
    """List the patient's programmes, newest first, with completed, missed and upcoming visits."""
    with db.read() as c:
        patients.get(c, patient_id)
        rows = programmes.of_patient(c, patient_id)
    trail.record_opened(user, "programmes.opened", "patient", patient_id)
    return rows


@router.post(
    "/patients/{patient_id}/programmes",
    status_code=201,
    response_model=programmes.Programme,
    responses=refusals(409),
)
def start_programme(
    patient_id: Id, body: schemas.ProgrammeNew, db: Db, user: Planner
) -> programmes.Programme:
    """Start a programme for the patient."""
    with db.write() as c:
        return programmes.start(c, user, patient_id, **body.values())


@router.delete("/programmes/{programme_id}", status_code=204)
def end_programme(programme_id: Id, db: Db, user: Planner) -> None:
    """Remove a programme and its plan; its sessions remain."""
    with db.write() as c:
        programmes.end(c, user, programme_id)


@router.patch("/planned-visits/{visit_id}", response_model=programmes.Programme, responses=refusals(409))
def change_planned_visit(
    visit_id: Id, body: schemas.PlannedVisitChange, db: Db, user: Planner
) -> programmes.Programme:
    """Reschedule a planned visit or link it to a session; omitted fields are unchanged."""
    with db.write() as c:
        return programmes.change_visit(c, user, visit_id, body.values())
