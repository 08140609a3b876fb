"""Dated notes about a patient."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter

from sagittal.server.api import schemas
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import notes, patients
from sagittal.server.context import Db, Id, OpenTrail
from sagittal.server.http.json_body import StrictJsonRoute

router = APIRouter(route_class=StrictJsonRoute, tags=["patients"])
Writer = Annotated[Identity, require(Action.WRITE_PATIENT)]


@router.get("/patients/{patient_id}/notes", response_model=list[notes.PatientNote])
def list_notes(
    patient_id: Id, db: Db, trail: OpenTrail, user: Annotated[Identity, require(Action.READ_PATIENT)]
) -> list[notes.PatientNote]:
    """List notes about a patient, latest date first."""
    with db.read() as c:
        patients.get(c, patient_id)
        rows = notes.of_patient(c, patient_id)
    trail.record_opened(user, "notes.opened", "patient", patient_id)
    return rows


@router.post("/patients/{patient_id}/notes", status_code=201, response_model=notes.PatientNote)
def add_note(patient_id: Id, body: schemas.NoteNew, db: Db, user: Writer) -> notes.PatientNote:
    """Add a note about a patient."""
    with db.write() as c:
        return notes.add(c, user, patient_id, **body.values())


@router.delete("/notes/{note_id}", status_code=204)
def remove_note(note_id: Id, db: Db, user: Writer) -> None:
    """Delete a note, one's own or, as an administrator, any; the audit log records the deletion."""
    with db.write() as c:
        notes.remove(c, user, note_id, of_others=user.may(Action.MANAGE_USERS))
