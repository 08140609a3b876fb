"""Consents of patients: purpose, date, evidence and withdrawal.

Consents are never overwritten: a withdrawal is recorded with its date, and consent can be given again later.
They are deleted only together with the patient.
"""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass

from sqlalchemy import Connection, insert, select, update

from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import patients
from sagittal.server.errors import Conflict, NotFound, ServiceError
from sagittal.server.storage.schema.person_tables import CONSENT_PURPOSES, consent
from sagittal.server.storage.schema.tables import new_id, now, user


@dataclass(frozen=True)
class Consent:
    """Consent of a patient for one purpose.

    Parameters
    ----------
    purpose : one of CONSENT_PURPOSES. evidence : reference to the document, "signed form, file 12".
    withdrawn_on : None = in force. by : name of the user who recorded it, None = the program.
    """

    id: str
    patient_id: str
    purpose: str
    given_on: dt.date
    evidence: str
    withdrawn_on: dt.date | None
    created_at: dt.datetime
    by: str | None


def give(
    c: Connection,
    actor: audit.Actor | None,
    patient_id: str,
    *,
    purpose: str,
    evidence: str,
    given_on: dt.date | None = None,
) -> Consent:
    """Record a consent, dated today by default.

    Raises
    ------
    NotFound; Conflict `agreed_already`; ServiceError `bad_value`.
    """
    patients.get(c, patient_id)
    today = now().date()
    day = given_on or today
    if purpose not in CONSENT_PURPOSES:
        raise ServiceError(
            "bad_value",
            Message(
                "'{purpose}' is not a valid purpose; expected {CONSENT_PURPOSES}.",
                purpose=purpose,
                CONSENT_PURPOSES=", ".join(CONSENT_PURPOSES),
            ),
        )
    if not 1 <= len(evidence.strip()) <= 200:
        raise ServiceError("bad_value", "State in 1 to 200 characters where the consent is documented.")
    if not dt.date(1900, 1, 1) <= day <= today:
        raise ServiceError(
            "bad_value",
            Message("The day is {isoformat}. Expected today or an earlier day.", isoformat=day.isoformat()),
        )
    if any(one.purpose == purpose and one.withdrawn_on is None for one in of_patient(c, patient_id)):
        raise Conflict("agreed_already", "This consent is already recorded and in force.")
    consent_id = new_id()
    c.execute(
        insert(consent).values(
            id=consent_id,
            patient_id=patient_id,
            purpose=purpose,
            given_on=day,
            evidence=evidence.strip(),
            created_at=now(),
            created_by=None if actor is None else actor.user_id,
        )
    )
    detail = {"consent_id": consent_id, "purpose": purpose}
    audit.record(c, actor, "consent.given", "patient", patient_id, detail)
    return get(c, consent_id)


def withdraw(c: Connection, actor: audit.Actor | None, consent_id: str) -> Consent:
    """Record a withdrawal as of today; raises NotFound, Conflict withdrawn_already."""
    current = get(c, consent_id)
    if current.withdrawn_on is not None:
        raise Conflict("withdrawn_already", "The withdrawal is already recorded.")
    c.execute(update(consent).where(consent.c.id == consent_id).values(withdrawn_on=now().date()))
    detail = {"consent_id": consent_id, "purpose": current.purpose}
    audit.record(c, actor, "consent.withdrawn", "patient", current.patient_id, detail)
    return get(c, consent_id)


def get(c: Connection, consent_id: str) -> Consent:
    """One consent; raises NotFound."""
    row = c.execute(_QUERY.where(consent.c.id == consent_id)).first()
    if row is None:
        raise NotFound("consent", consent_id)
    return Consent(**row._asdict())


def of_patient(c: Connection, patient_id: str) -> list[Consent]:
    """Consents of a patient, those in force first, then the latest."""
    query = _QUERY.where(consent.c.patient_id == patient_id)
    ordered = query.order_by(consent.c.withdrawn_on.is_not(None), consent.c.given_on.desc(), consent.c.id)
    return [Consent(**row._asdict()) for row in c.execute(ordered)]


_QUERY = select(
    consent.c.id,
    consent.c.patient_id,
    consent.c.purpose,
    consent.c.given_on,
    consent.c.evidence,
    consent.c.withdrawn_on,
    consent.c.created_at,
    user.c.name.label("by"),
).outerjoin(user, user.c.id == consent.c.created_by)
