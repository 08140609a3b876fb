"""Jobs as shown on pages: with their session and patient."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Select, bindparam, func, join, select

from sagittal.server import audit
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.sight import only_seen
from sagittal.server.errors import NotFound
from sagittal.server.jobs.queue import VIEW_COLUMNS, JobQueue, JobView
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import ACTIVE_STATES, job, patient, recording, session


@dataclass(frozen=True)
class ListedJob(JobView):
    """A job with its patient and session (None for jobs without a recording)."""

    session_id: str | None
    session_title: str | None
    patient_id: str | None
    patient_code: str | None


def list_jobs(
    c: Connection, user: Identity | None, *, active_only: bool = False, limit: int = 100
) -> list[ListedJob]:
    """Jobs of the patients that a user may open, newest first; None = the system, all."""
    query = only_seen(_QUERY, user).order_by(job.c.seq.desc()).limit(limit)
    if active_only:
        query = query.where(job.c.state.in_(ACTIVE_STATES))
    return [_listed(row) for row in c.execute(query)]


def list_active(c: Connection, patient_ids: Collection[str]) -> list[ListedJob]:
    """Queued and running jobs of these patients, running ones first, then the newest."""
    query = _QUERY.where(job.c.state.in_(ACTIVE_STATES), session.c.patient_id.in_(patient_ids))
    return [
        _listed(row) for row in c.execute(query.order_by((job.c.state == "running").desc(), job.c.seq.desc()))
    ]


def count_active(db: Database, user: Identity) -> int:
    """Number of queued and running jobs of the patients that a user may open."""
    [[count]] = db.ask(select_active_count(user))
    return int(count)


def select_active_count(user: Identity) -> Select[Any]:
    """SQL statement for `count_active`."""
    query = select(func.count()).select_from(_JOBS).where(job.c.state.in_(ACTIVE_STATES))
    return only_seen(query, user)


def of_session(c: Connection, session_id: str, *, kind: str | None = None) -> list[JobView]:
    """Jobs of one session, newest first."""
    query = _OF_SESSION if kind is None else _OF_SESSION.where(job.c.kind == kind)
    return [_listed(row) for row in c.execute(query, {"of_session": session_id})]


def get(c: Connection, job_id: str) -> ListedJob:
    """One job; raises NotFound."""
    row = c.execute(_QUERY.where(job.c.id == job_id)).first()
    if row is None:
        raise NotFound("job", job_id)
    return _listed(row)


def cancel(c: Connection, queue: JobQueue, actor: audit.Actor | None, job_id: str) -> JobView:
    """Request cancellation of a job (no effect if finished); raises NotFound."""
    view = queue.cancel(c, job_id)
    if view is None:
        raise NotFound("job", job_id)
    audit.record(c, actor, "job.cancelled", "job", job_id, {"state": view.state})
    return view


_JOBS = (
    join(job, recording, recording.c.id == job.c.recording_id, isouter=True)
    .outerjoin(session, session.c.id == recording.c.session_id)
    .outerjoin(patient, patient.c.id == session.c.patient_id)
)
_QUERY = select(
    *VIEW_COLUMNS,
    session.c.id.label("session_id"),
    session.c.title.label("session_title"),
    patient.c.id.label("patient_id"),
    patient.c.code.label("patient_code"),
).select_from(_JOBS)

_OF_SESSION = _QUERY.where(session.c.id == bindparam("of_session")).order_by(job.c.seq.desc())


def _listed(row: Any) -> ListedJob:
    return ListedJob(**{name: getattr(row, name) for name in ListedJob.__dataclass_fields__})
