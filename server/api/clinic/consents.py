"""Consents of patients."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import consents, patients
from sagittal.server.context import Db, Id, OpenTrail
from sagittal.server.http.json_body import StrictJsonRoute

router = APIRouter(route_class=StrictJsonRoute, tags=["patients"])
Writer = Annotated[Identity, require(Action.WRITE_PATIENT)]


@router.get("/patients/{patient_id}/consents", response_model=list[consents.Consent])
def list_consents(
    patient_id: Id, db: Db, trail: OpenTrail, user: Annotated[Identity, require(Action.READ_PATIENT)]
) -> list[consents.Consent]:
    """List consents of a patient, those in force first."""
    with db.read() as c:
        patients.get(c, patient_id)
        rows = consents.of_patient(c, patient_id)
    trail.record_opened(user, "consents.opened", "patient", patient_id)
    return rows


@router.post(
    "/patients/{patient_id}/consents",
    status_code=201,
    response_model=consents.Consent,
    responses=refusals(409),
)
def give_consent(patient_id: Id, body: schemas.ConsentNew, db: Db, user: Writer) -> consents.Consent:
    """Record a patient's consent."""
    with db.write() as c:
        return consents.give(c, user, patient_id, **body.values())


@router.post("/consents/{consent_id}/withdraw", response_model=consents.Consent, responses=refusals(409))
def withdraw_consent(consent_id: Id, db: Db, user: Writer) -> consents.Consent:
    """Record the withdrawal of a consent as of today; the consent remains on record."""
    with db.write() as c:
        return consents.withdraw(c, user, consent_id)
