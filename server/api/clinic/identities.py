"""Identities of patients, stored in addition to the pseudonym."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import identities
from sagittal.server.clinic.identities import PatientIdentity
from sagittal.server.context import Config, Db, Id, OpenTrail
from sagittal.server.http.json_body import StrictJsonRoute

router = APIRouter(route_class=StrictJsonRoute, tags=["patients"])


@router.get("/patients/{patient_id}/identity", response_model=PatientIdentity, responses=refusals(409))
def read_identity(
    patient_id: Id,
    db: Db,
    settings: Config,
    trail: OpenTrail,
    user: Annotated[Identity, require(Action.READ_IDENTITY)],
) -> PatientIdentity:
    """Name, date of birth, numbers and contact of a patient; null = not recorded. Not available to tokens."""
    with db.read() as c:
        identity = identities.get(c, settings.identity_key_file, patient_id)
    trail.record_opened(user, "identity.opened", "patient", patient_id)
    return identity


@router.patch("/patients/{patient_id}/identity", response_model=PatientIdentity, responses=refusals(409))
def change_identity(
    patient_id: Id,
    body: schemas.IdentityChange,
    db: Db,
    settings: Config,
    user: Annotated[Identity, require(Action.WRITE_IDENTITY)],
) -> PatientIdentity:
    """Update the identity of a patient; omitted fields are unchanged, null clears a value."""
    with db.write() as c:
        return identities.change(c, settings.identity_key_file, user, patient_id, body.values())
