"""Sessions: one visit's recordings of a patient, and in what state they are."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, insert, select, update

from core.frames import PROTOCOLS
from server import audit
from server.services.errors import NotFound, ServiceError
from server.storage.tables import (
    ACTIVE_STATES,
    analysis,
    job,
    new_id,
    now,
    patient,
    recording,
    recording_file,
    session,
)

CHANGEABLE = frozenset({"title", "performed_on", "protocol", "height_m", "note"})


@dataclass(frozen=True)
class Session:
    """A session with its patient's code and the state its pages show.

    Parameters
    ----------
    state : empty (no files), uploaded, running (a job is queued or running), done (has a result), failed (the
        last job failed and there is no result).
    height_m : measured at this visit, None = use the patient's.
    """

    id: str
    patient_id: str
    patient_code: str
    title: str
    performed_on: dt.date
    protocol: str
    height_m: float | None
    note: str
    created_at: dt.datetime
    state: str


def create(
    c: Connection,
    actor: audit.Actor | None,
    patient_id: str,
    *,
    title: str = "",
    performed_on: dt.date | None = None,
    protocol: str = "walk",
    height_m: float | None = None,
    note: str = "",
) -> Session:
    """Add a session; raises NotFound for the patient, ServiceError bad_value."""
    if c.execute(select(patient.c.id).where(patient.c.id == patient_id)).first() is None:
        raise NotFound("patient", patient_id)
    day = performed_on or now().date()
    values = {
        "title": title.strip() or "Gait recording",
        "performed_on": day,
        "protocol": protocol,
        "height_m": height_m,
        "note": note,
    }
    session_id = new_id()
    row = {"id": session_id, "patient_id": patient_id, "created_at": now(), **_checked(values)}
    c.execute(insert(session).values(**row))
    audit.record(c, actor, "session.created", "session", session_id, {"patient_id": patient_id})
    return get(c, session_id)


def change(
    c: Connection, actor: audit.Actor | None, session_id: str, values: Mapping[str, object]
) -> Session:
    """Change some of CHANGEABLE; raises NotFound, ServiceError bad_value."""
    before = get(c, session_id)
    changed = {name: value for name, value in _checked(values).items() if getattr(before, name) != value}
    if changed:
        c.execute(update(session).where(session.c.id == session_id).values(**changed))
        audit.record(c, actor, "session.changed", "session", session_id, {"fields": sorted(changed)})
    return get(c, session_id)


def get(c: Connection, session_id: str) -> Session:
    """One session; raises NotFound."""
    row = c.execute(_QUERY.where(session.c.id == session_id)).first()
    if row is None:
        raise NotFound("session", session_id)
    return _session(c, row)


def of_patient(c: Connection, patient_id: str) -> list[Session]:
    """All sessions of a patient, the newest day first."""
    query = _QUERY.where(session.c.patient_id == patient_id)
    rows = c.execute(query.order_by(session.c.performed_on.desc(), session.c.created_at.desc())).all()
    return [_session(c, row) for row in rows]


_QUERY = select(session, patient.c.code.label("patient_code")).join(
    patient, patient.c.id == session.c.patient_id
)


def _session(c: Connection, row: Any) -> Session:
    return Session(**row._asdict(), state=_state(c, row.id))


def _state(c: Connection, session_id: str) -> str:
    mine = select(recording.c.id).where(recording.c.session_id == session_id).scalar_subquery()
    jobs = c.execute(
        select(job.c.state).where(job.c.recording_id.in_(mine)).order_by(job.c.seq.desc())
    ).scalars()
    states = list(jobs)
    if any(state in ACTIVE_STATES for state in states):
        return "running"
    if c.execute(select(analysis.c.id).where(analysis.c.recording_id.in_(mine)).limit(1)).first():
        return "done"
    if states and states[0] == "failed":
        return "failed"
    has_files = c.execute(
        select(recording_file.c.name).where(recording_file.c.recording_id.in_(mine)).limit(1)
    ).first()
    return "uploaded" if has_files else "empty"


def _checked(values: Mapping[str, object]) -> dict[str, Any]:
    unknown = values.keys() - CHANGEABLE
    if unknown:
        raise ServiceError("bad_value", f"A session has no {', '.join(sorted(unknown))}.")
    checked = dict(values)
    if "title" in checked and not 1 <= len(str(checked["title"])) <= 200:
        raise ServiceError("bad_value", "A session's title has 1 to 200 characters.")
    if checked.get("protocol", PROTOCOLS[0]) not in PROTOCOLS:
        raise ServiceError("bad_value", f"The protocol is one of {', '.join(PROTOCOLS)}.")
    height = checked.get("height_m")
    if height is not None and not (isinstance(height, int | float) and 0.5 <= height <= 2.5):
        raise ServiceError("bad_value", f"Body height is {height}, expected 0.5 to 2.5 m.")
    return checked
