"""Patients, identified by the clinic's own pseudonyms."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import StreamingResponse
from sqlalchemy import Connection

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.api.downloads.downloads import BINARY, write_disposition
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.auth.sight import may_open
from sagittal.server.clinic import patients, programmes, sessions
from sagittal.server.context import Blobs, Config, Db, Failures, Id, LiveHub, OpenTrail, Reviewed, address_of
from sagittal.server.downloads import patient_export
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.safekeeping import erasure
from sagittal.server.sharing import care_teams

router = APIRouter(route_class=StrictJsonRoute, prefix="/patients", tags=["patients"])


@router.get("", response_model=list[patients.Patient])
def list_patients(
    db: Db,
    trail: OpenTrail,
    user: Annotated[Identity, require(Action.READ_PATIENT)],
    q: Annotated[str, Query(max_length=200, description="part of a code or a note")] = "",
    limit: Annotated[int, Query(ge=1, le=1000)] = 200,
    offset: Annotated[int, Query(ge=0, le=10**9)] = 0,
) -> list[patients.Patient]:
    """List all patients, latest visit first."""
    with db.read() as c:
        rows = patients.list_patients(c, user, search=q, limit=limit, offset=offset)
    trail.record_watched(user, "patient.listed", "patient", None)
    return rows


class _CodeDoor:
    """Transactions that assign a code to a patient, which reveal whether a guessed code exists.

    Conflicts with codes of inaccessible patients are counted and recorded, as in emergency access.
    """

    def __init__(self, request: Request, db: Db, trail: OpenTrail, failures: Failures) -> None:
        self._address = f"codes {address_of(request)}"
        self._db, self._trail, self._failures = db, trail, failures

    @contextmanager
    def write(self, user: Identity) -> Iterator[Connection]:
        """Writing transaction; raises Problem 429 after too many conflicts with such codes."""
        account, hidden = f"codes of {user.user_id}", None
        # counted before the attempt, so that a burst of guesses cannot pass before the first is counted
        begun = self._failures.begin(account, self._address)
        try:
            with self._db.write() as c:
                try:
                    yield c
                except patients.CodeTaken as taken:
                    one = taken.patient_id
                    if one is not None and not may_open(c, user, {"patient_id": one}):
                        hidden = one
                    raise
        except patients.CodeTaken:
            if hidden is not None:
                self._trail.record_opened(user, "patient.code_refused", "patient", hidden)
            raise
        finally:
            if hidden is None:
                self._failures.withdraw(account, self._address, begun)


CodeDoor = Annotated[_CodeDoor, Depends()]


@router.post("", status_code=201, response_model=patients.Patient, responses=refusals(409, 429))
def add_patient(
    body: schemas.PatientNew, door: CodeDoor, user: Annotated[Identity, require(Action.WRITE_PATIENT)]
) -> patients.Patient:
    """Add a patient."""
    with door.write(user) as c:
        patient = patients.create(c, user, **body.values())
        care_teams.add_maker(c, user, patient.id)
        return patient


@router.get("/{patient_id}", response_model=patients.Patient)
def read_patient(
    patient_id: Id, db: Db, trail: OpenTrail, user: Annotated[Identity, require(Action.READ_PATIENT)]
) -> patients.Patient:
    """Open a patient."""
    with db.read() as c:
        patient = patients.get(c, patient_id)
    trail.record_opened(user, "patient.opened", "patient", patient_id)
    return patient


@router.patch("/{patient_id}", response_model=patients.Patient, responses=refusals(409, 429))
def change_patient(
    patient_id: Id,
    body: schemas.PatientChange,
    db: Db,
    door: CodeDoor,
    user: Annotated[Identity, require(Action.WRITE_PATIENT)],
) -> patients.Patient:
    """Change a patient; omitted fields are unchanged."""
    values = body.values()
    with door.write(user) if "code" in values else db.write() as c:
        return patients.change(c, user, patient_id, values)


@router.delete("/{patient_id}", status_code=204, responses=refusals(409))
def delete_patient(
    patient_id: Id,
    confirm: Annotated[str, Query(max_length=64, description="the patient's code, as confirmation")],
    db: Db,
    reviewed: Reviewed,
    settings: Config,
    hub: LiveHub,
    user: Annotated[Identity, require(Action.DELETE_PATIENT)],
) -> None:
    """Permanently delete a patient with all sessions, recordings and results; only audit rows remain."""
    with db.read() as c:
        if confirm.strip() == patients.get(c, patient_id).code:
            visits = [visit.id for visit in sessions.of_patient(c, patient_id)]
        else:
            visits = []
    hub.drop_from_thread(visits)
    erasure.erase_patient(db, reviewed, settings, user, patient_id, confirm=confirm)


@router.get(
    "/{patient_id}/export",
    response_class=StreamingResponse,
    responses={
        200: {"description": "All of it as one zip", "content": {"application/zip": {"schema": BINARY}}}
    },
)
def export(
    patient_id: Id,
    db: Db,
    blobs: Blobs,
    settings: Config,
    trail: OpenTrail,
    user: Annotated[Identity, require(Action.EXPORT_PATIENT)],
) -> StreamingResponse:
    """All stored data of a patient: rows as JSON, access log, and all files."""
    key_file = settings.identity_key_file if user.may(Action.READ_IDENTITY) else None
    pieces = patient_export.export_patient(db, blobs, patient_id, key_file)
    trail.record_opened(user, "patient.exported", "patient", patient_id)
    headers = {"Content-Disposition": write_disposition(f"patient-{patient_id[:8]}.zip")}
    return StreamingResponse(pieces, media_type="application/zip", headers=headers)


@router.get("/{patient_id}/sessions", response_model=list[sessions.Session])
def list_sessions(
    patient_id: Id, db: Db, trail: OpenTrail, user: Annotated[Identity, require(Action.READ_SESSION)]
) -> list[sessions.Session]:
    """List the patient's visits, newest first."""
    with db.read() as c:
        patients.get(c, patient_id)
        rows = sessions.of_patient(c, patient_id)
    trail.record_opened(user, "sessions.opened", "patient", patient_id)
    return rows


@router.post(
    "/{patient_id}/sessions", status_code=201, response_model=sessions.Session, responses=refusals(409)
)
def add_session(
    patient_id: Id,
    body: schemas.PlannedSessionNew,
    db: Db,
    user: Annotated[Identity, require(Action.CREATE_SESSION)],
) -> sessions.Session:
    """Add a visit."""
    values = body.values()
    planned = values.pop("planned_visit_id", None)
    with db.write() as c:
        session = sessions.create(c, user, patient_id, **values)
        if planned is not None:
            programmes.change_visit(c, user, planned, {"session_id": session.id})
        return session
