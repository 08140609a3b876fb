"""Sessions: the recordings of one visit of a patient, and their state."""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Connection, bindparam, case, exists, func, insert, select, update

from sagittal.core.frames import PROTOCOLS, Protocol
from sagittal.core.message import Message
from sagittal.core.subject.condition import (
    CHOICES,
    Footwear,
    Orthosis,
    WalkingAid,
    WalkingCondition,
    WalkingPace,
)
from sagittal.server import audit
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.sight import only_seen
from sagittal.server.errors import NotFound, ServiceError
from sagittal.server.jobs.queue import BESIDE
from sagittal.server.storage.schema.columns import make_all
from sagittal.server.storage.schema.tables import (
    ACTIVE_STATES,
    analysis,
    job,
    new_id,
    now,
    patient,
    recording,
    recording_file,
    session,
    session_video,
)

WALKS: Final = ("walk", "treadmill")
"""Protocols whose speed is a gait speed."""

CHANGEABLE = frozenset({"title", "performed_on", "protocol", "height_m", *CHOICES, "feedback", "note"})


@dataclass(frozen=True)
class Session:
    """A session with its patient's code and the state shown on pages.

    Parameters
    ----------
    state : empty (no files), uploaded, running (a job is queued or running), done (has a result), failed (the
        last job failed and there is no result).
    height_m : measured at this visit, None = use the patient's.
    pace, aid, orthosis, shoes : walking condition (core/subject/condition.py), None = not recorded.
    feedback : biofeedback was given; set automatically by live trials.
    has_video : a video is synchronised with its trial.
    """

    id: str
    patient_id: str
    patient_code: str
    title: str
    performed_on: dt.date
    protocol: Protocol
    height_m: float | None
    pace: WalkingPace | None
    aid: WalkingAid | None
    orthosis: Orthosis | None
    shoes: Footwear | None
    feedback: bool
    note: str
    created_at: dt.datetime
    has_video: bool
    state: str

    def walked(self, belt_speed_mps: float | None = None) -> WalkingCondition:
        """Walking condition of its trial; treadmill speed is in the manifest of its recording."""
        return WalkingCondition(
            self.pace,
            self.aid,
            self.orthosis,
            self.shoes,
            self.feedback,
            self.protocol,
            belt_speed_mps if self.protocol == "treadmill" else None,
        )


@dataclass(frozen=True)
class WalkedSession:
    """Attributes of an analysed walk that determine which walk it is compared with."""

    id: str
    performed_on: dt.date
    condition: WalkingCondition


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
    **condition: object,
) -> Session:
    """Add a session; raises NotFound for the patient, ServiceError bad_value.

    Parameters
    ----------
    condition : pace, aid, orthosis, shoes, feedback as in `Session`; not recorded if omitted.
    """
    if c.execute(select(patient.c.id).where(patient.c.id == patient_id)).first() is None:
        raise NotFound("patient", patient_id)
    day = performed_on or now().date()
    values = {
        "title": title.strip() or "Gait recording",
        "performed_on": day,
        "protocol": protocol,
        "height_m": height_m,
        "note": note,
        **condition,
    }
    session_id = new_id()
    row = {"id": session_id, "patient_id": patient_id, "created_at": now(), **_checked(values)}
    c.execute(insert(session).values(**row))
    audit.record(c, actor, "session.created", "session", session_id, {"patient_id": patient_id})
    return get(c, session_id)


def change(
    c: Connection, actor: audit.Actor | None, session_id: str, values: Mapping[str, object]
) -> Session:
    """Update some of CHANGEABLE; raises NotFound, ServiceError bad_value."""
    previous = get(c, session_id)
    changed = {name: value for name, value in _checked(values).items() if getattr(previous, name) != value}
    if changed:
        c.execute(update(session).where(session.c.id == session_id).values(**changed))
        audit.record(c, actor, "session.changed", "session", session_id, {"fields": sorted(changed)})
    return get(c, session_id)


def get(c: Connection, session_id: str) -> Session:
    """One session; raises NotFound."""
    row = c.execute(_ONE, {"one_id": session_id}).first()
    if row is None:
        raise NotFound("session", session_id)
    return Session(**row._asdict())


def of_patient(c: Connection, patient_id: str) -> list[Session]:
    """All sessions of a patient, latest date first."""
    return make_all(Session, c.execute(_OF_PATIENT, {"of_patient": patient_id}))


def search(
    c: Connection,
    user: Identity | None,
    *,
    search: str = "",
    protocol: Protocol | None = None,
    since: dt.date | None = None,
    until: dt.date | None = None,
    ids: Collection[str] = (),
) -> list[Session]:
    """Sessions of all accessible patients whose code or note contains `search`, by patient and date.

    Parameters
    ----------
    user : None = the system, which sees all.
    since, until : dates, inclusive, None = open. ids : restrict to these; empty = all.
    """
    query = only_seen(_QUERY, user).order_by(
        patient.c.code, session.c.performed_on, session.c.created_at, session.c.id
    )
    if text := search.strip():
        query = query.where(
            patient.c.code.icontains(text, autoescape=True) | patient.c.note.icontains(text, autoescape=True)
        )
    if protocol is not None:
        query = query.where(session.c.protocol == protocol)
    if since is not None:
        query = query.where(session.c.performed_on >= since)
    if until is not None:
        query = query.where(session.c.performed_on <= until)
    if ids:
        query = query.where(session.c.id.in_(ids))
    return make_all(Session, c.execute(query))


def newest_of(c: Connection, patient_ids: Collection[str]) -> dict[str, Session]:
    """Latest session of each of these patients by patient id; patients without one are omitted."""
    place = func.row_number().over(partition_by=session.c.patient_id, order_by=_NEWEST)
    ranked = (
        select(session.c.id, place.label("place")).where(session.c.patient_id.in_(patient_ids)).subquery()
    )
    newest = select(ranked.c.id).where(ranked.c.place == 1)
    rows = make_all(Session, c.execute(_QUERY.where(session.c.id.in_(newest))))
    return {s.patient_id: s for s in rows}


def list_walks(c: Connection, patient_ids: Collection[str]) -> dict[str, list[WalkedSession]]:
    """Analysed walks without feedback by patient, newest first; treadmill speed is not read."""
    done = exists().where(analysis.c.recording_id == recording.c.id, _MINE).correlate(session)
    columns = [session.c[name] for name in ("id", "patient_id", "performed_on", "protocol", *CHOICES)]
    query = (
        select(*columns)
        .where(session.c.patient_id.in_(patient_ids), session.c.protocol.in_(WALKS), done)
        .where(session.c.feedback.is_(False))
        .order_by(*_NEWEST)
    )
    walks: dict[str, list[WalkedSession]] = {}
    conditions: dict[tuple[Any, ...], WalkingCondition] = {}
    for session_id, patient_id, performed_on, *walked in c.execute(query):
        condition_key = tuple(walked)
        if condition_key not in conditions:  # a clinic has only a few
            conditions[condition_key] = WalkingCondition(
                **dict(zip(("protocol", *CHOICES), condition_key, strict=True))
            )
        walks.setdefault(patient_id, []).append(
            WalkedSession(session_id, performed_on, conditions[condition_key])
        )
    return walks


_NEWEST = (session.c.performed_on.desc(), session.c.created_at.desc(), session.c.id)

_MINE = recording.c.session_id == session.c.id
_JOBS = (
    select(job.c.state)
    .join(recording, recording.c.id == job.c.recording_id)
    .where(_MINE, job.c.kind.not_in(BESIDE))
)
_ACTIVE = (
    select(recording.c.session_id)
    .join(job, job.c.recording_id == recording.c.id)
    .where(job.c.state.in_(ACTIVE_STATES), job.c.kind.not_in(BESIDE))
    .correlate(None)
)
"""One query for all sessions: per session, it would scan all queued jobs each time."""
_STATE = case(
    (session.c.id.in_(_ACTIVE), "running"),
    (exists().where(analysis.c.recording_id == recording.c.id, _MINE).correlate(session), "done"),
    (_JOBS.order_by(job.c.seq.desc()).limit(1).correlate(session).scalar_subquery() == "failed", "failed"),
    (exists().where(recording_file.c.recording_id == recording.c.id, _MINE).correlate(session), "uploaded"),
    else_="empty",
)
"""State of a session, as part of the statement that reads it, so that any number of sessions needs
only one.
"""

_HAS_VIDEO = exists().where(session_video.c.session_id == session.c.id).correlate(session)

_QUERY = select(
    session, patient.c.code.label("patient_code"), _HAS_VIDEO.label("has_video"), _STATE.label("state")
).join(patient, patient.c.id == session.c.patient_id)
_ONE = _QUERY.where(session.c.id == bindparam("one_id"))
_OF_PATIENT = _QUERY.where(session.c.patient_id == bindparam("of_patient")).order_by(*_NEWEST)


def _checked(values: Mapping[str, object]) -> dict[str, Any]:
    unknown = values.keys() - CHANGEABLE
    if unknown:
        raise ServiceError("bad_value", Message("A visit has no {join}.", join=", ".join(sorted(unknown))))
    checked = dict(values)
    if "title" in checked and not 1 <= len(str(checked["title"])) <= 200:
        raise ServiceError("bad_value", "A visit's title has 1 to 200 characters.")
    if checked.get("protocol", PROTOCOLS[0]) not in PROTOCOLS:
        raise ServiceError(
            "bad_value", Message("The protocol is one of {PROTOCOLS}.", PROTOCOLS=", ".join(PROTOCOLS))
        )
    for name, words in CHOICES.items():
        if checked.get(name) is not None and checked[name] not in words:
            raise ServiceError(
                "bad_value",
                Message(
                    "{name} must be one of {words}, or null if not stated.", name=name, words=", ".join(words)
                ),
            )
    if not isinstance(checked.get("feedback", False), bool):
        raise ServiceError("bad_value", "feedback is true or false.")
    height = checked.get("height_m")
    if height is not None and not (isinstance(height, int | float) and 0.5 <= height <= 2.5):
        raise ServiceError(
            "bad_value", Message("Body height is {height}, expected 0.5 to 2.5 m.", height=height)
        )
    return checked
