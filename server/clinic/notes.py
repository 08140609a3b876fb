"""Dated free-text notes of therapists about a patient."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass

from sqlalchemy import Connection, delete, insert, select

from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import patients
from sagittal.server.clinic.calendar_days import require_day
from sagittal.server.errors import NotAllowed, NotFound, ServiceError
from sagittal.server.storage.schema.tables import new_id, now, patient_note, user

MOST_CHARACTERS = 10_000


@dataclass(frozen=True)
class PatientNote:
    """A note; `by`, `by_id` = name and account of the author, None = the program."""

    id: str
    patient_id: str
    written_on: dt.date
    content: str
    created_at: dt.datetime
    by: str | None
    by_id: str | None


def add(
    c: Connection,
    actor: audit.Actor | None,
    patient_id: str,
    content: str,
    written_on: dt.date | None = None,
) -> PatientNote:
    """Add a note, dated today by default; raises NotFound, ServiceError bad_value."""
    patients.get(c, patient_id)
    text = content.strip()
    if not 1 <= len(text) <= MOST_CHARACTERS:
        raise ServiceError(
            "bad_value",
            Message("A note has 1 to {MOST_CHARACTERS:,} characters.", MOST_CHARACTERS=MOST_CHARACTERS),
        )
    note_id = new_id()
    c.execute(
        insert(patient_note).values(
            id=note_id,
            patient_id=patient_id,
            written_on=require_day(written_on or now().date()),
            content=text,
            created_at=now(),
            created_by=None if actor is None else actor.user_id,
        )
    )
    audit.record(c, actor, "note.added", "patient", patient_id, {"note_id": note_id})
    return get(c, note_id)


def may_remove(note: PatientNote, actor: audit.Actor | None, *, of_others: bool) -> bool:
    """Whether a user may remove this note: their own, or any if `of_others`."""
    return of_others or actor is None or note.by_id in {None, actor.user_id}


def remove(c: Connection, actor: audit.Actor | None, note_id: str, *, of_others: bool = False) -> None:
    """Delete a note; raises NotFound, NotAllowed not_yours.

    Parameters
    ----------
    of_others : also permit notes of other authors.
    """
    note = get(c, note_id)
    if not may_remove(note, actor, of_others=of_others):
        raise NotAllowed(
            "not_yours",
            Message("{by} wrote this note. Ask that person or an administrator to remove it.", by=note.by),
        )
    c.execute(delete(patient_note).where(patient_note.c.id == note_id))
    audit.record(c, actor, "note.removed", "patient", note.patient_id, {"note_id": note_id})


def get(c: Connection, note_id: str) -> PatientNote:
    """One note; raises NotFound."""
    row = c.execute(_QUERY.where(patient_note.c.id == note_id)).first()
    if row is None:
        raise NotFound("note", note_id)
    return PatientNote(**row._asdict())


def of_patient(c: Connection, patient_id: str) -> list[PatientNote]:
    """Notes about a patient, latest day first."""
    query = _QUERY.where(patient_note.c.patient_id == patient_id)
    rows = c.execute(query.order_by(patient_note.c.written_on.desc(), patient_note.c.created_at.desc()))
    return [PatientNote(**row._asdict()) for row in rows]


_QUERY = select(
    patient_note.c.id,
    patient_note.c.patient_id,
    patient_note.c.written_on,
    patient_note.c.content,
    patient_note.c.created_at,
    user.c.name.label("by"),
    patient_note.c.created_by.label("by_id"),
).outerjoin(user, user.c.id == patient_note.c.created_by)
