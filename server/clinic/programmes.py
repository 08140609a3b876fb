"""Training programme of a patient: planned visits that are done, missed or upcoming."""

from __future__ import annotations

import datetime as dt
import itertools
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from sqlalchemy import ColumnElement, Connection, delete, insert, select, update

from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import patients, sessions
from sagittal.server.clinic.calendar_days import require_day
from sagittal.server.clinic.course import COURSES, SIX_WEEKS, VisitKind
from sagittal.server.errors import Conflict, NotFound, ServiceError
from sagittal.server.storage.schema.tables import new_id, now, planned_visit, programme, session

VisitState = Literal["done", "missing", "next", "planned"]

NEAR = dt.timedelta(days=4)
"""A session this close to a planned date probably is that visit: half the interval of weekly visits."""


@dataclass(frozen=True)
class PlannedVisit:
    """A visit of a programme.

    Parameters
    ----------
    week : of the programme, 1 = that of the first training, 0 = before. session_id : linked session.
    performed_on : date of that session. state : done, missing (overdue), next, or planned.
    """

    id: str
    label: str
    kind: VisitKind
    week: int
    planned_on: dt.date
    session_id: str | None
    performed_on: dt.date | None
    state: VisitState


@dataclass(frozen=True)
class Programme:
    """Planned visits of a patient in order of date; `words` is a description."""

    id: str
    patient_id: str
    template: str
    words: str
    starts_on: dt.date
    created_at: dt.datetime
    visits: tuple[PlannedVisit, ...]

    @property
    def ends_on(self) -> dt.date:
        """Date of the last planned visit."""
        return max(v.planned_on for v in self.visits)

    @property
    def next(self) -> PlannedVisit | None:
        """The next visit, None if none is left."""
        return next((v for v in self.visits if v.state == "next"), None)

    def count(self, state: VisitState) -> int:
        """Number of visits in a state."""
        return sum(v.state == state for v in self.visits)

    def near(self, day: dt.date) -> PlannedVisit | None:
        """The open visit that best matches a session on this date."""
        open_ = [v for v in self.visits if v.session_id is None and abs(v.planned_on - day) <= NEAR]
        return min(open_, key=lambda v: abs(v.planned_on - day), default=None)


@dataclass(frozen=True)
class Plans:
    """Programmes of several patients.

    Parameters
    ----------
    kinds : see `list_kinds`. running : patients with upcoming visits in a programme.
    """

    kinds: Mapping[str, VisitKind]
    running: Collection[str]


def start(
    c: Connection,
    actor: audit.Actor | None,
    patient_id: str,
    *,
    starts_on: dt.date,
    template: str = SIX_WEEKS.name,
) -> Programme:
    """Start a programme for a patient; raises NotFound, Conflict programme_running, ServiceError
    bad_value.
    """
    patients.get(c, patient_id)
    if template not in COURSES:
        raise ServiceError(
            "bad_value",
            Message(
                "The programme is one of {COURSES}, not '{template}'.",
                COURSES=", ".join(COURSES),
                template=template,
            ),
        )
    course = COURSES[template]
    days = course.days(require_day(starts_on))
    for active in of_patient(c, patient_id):
        if min(days) <= active.ends_on and active.visits[0].planned_on <= max(days):
            raise Conflict(
                "programme_running",
                Message(
                    "This patient has a programme until {ends_on}; end it first or start after that day.",
                    ends_on=active.ends_on,
                ),
            )
    programme_id = new_id()
    row = {"id": programme_id, "patient_id": patient_id, "template": template, "starts_on": starts_on}
    c.execute(insert(programme).values(**row, created_at=now()))
    for position, (visit, day) in enumerate(zip(course.visits, days, strict=True)):
        planned = {"label": visit.label, "kind": visit.kind, "week": visit.week, "planned_on": day}
        keys = {"id": new_id(), "programme_id": programme_id, "position": position}
        c.execute(insert(planned_visit).values(**keys, **planned))
    audit.record(
        c,
        actor,
        "programme.started",
        "patient",
        patient_id,
        {"programme_id": programme_id, "template": template},
    )
    return get(c, programme_id)


def get(c: Connection, programme_id: str) -> Programme:
    """One programme; raises NotFound."""
    matches = _programmes(c, programme.c.id == programme_id)
    if not matches:
        raise NotFound("programme", programme_id)
    return matches[0]


def of_patient(c: Connection, patient_id: str) -> list[Programme]:
    """All programmes of a patient, newest first."""
    return _programmes(c, programme.c.patient_id == patient_id)


def list_kinds(c: Connection, patient_ids: Collection[str]) -> dict[str, VisitKind]:
    """Kind of visit by session, for those sessions of these patients that belong to a programme."""
    query = (
        select(planned_visit.c.session_id, planned_visit.c.kind)
        .join(programme)
        .where(programme.c.patient_id.in_(patient_ids), planned_visit.c.session_id.is_not(None))
    )
    return {row.session_id: row.kind for row in c.execute(query)}


def read_plans(c: Connection, patient_ids: Collection[str], today: dt.date) -> Plans:
    """Summary of the programmes of these patients for lists, in one statement."""
    columns = (planned_visit.c[name] for name in ("planned_on", "session_id", "kind"))
    relevant = planned_visit.c.session_id.is_not(None) | (planned_visit.c.planned_on >= today)
    query = select(programme.c.patient_id, *columns).join(planned_visit)
    rows = c.execute(query.where(programme.c.patient_id.in_(patient_ids), relevant)).all()
    return Plans(
        kinds={row.session_id: row.kind for row in rows if row.session_id is not None},
        running=frozenset(row.patient_id for row in rows if row.planned_on >= today),
    )


def change_visit(
    c: Connection, actor: audit.Actor | None, visit_id: str, values: Mapping[str, Any]
) -> Programme:
    """Reschedule a planned visit, or link it to a session (None = unlink).

    Raises
    ------
    NotFound: the visit or the session. Conflict: visit_taken (linked to another session), session_planned
    (the session is linked to another visit), other_patient. ServiceError bad_value.
    """
    row = _visit(c, visit_id)
    unknown = values.keys() - {"planned_on", "session_id"}
    if unknown or ("planned_on" in values and values["planned_on"] is None):
        raise ServiceError("bad_value", "A planned visit has a day planned_on and perhaps a session_id.")
    if isinstance(planned_on := values.get("planned_on"), dt.date):
        require_day(planned_on)
    if values.get("session_id") is not None:
        _check_session(c, row, values["session_id"])
    changed = {name: value for name, value in values.items() if getattr(row, name) != value}
    if changed:
        c.execute(update(planned_visit).where(planned_visit.c.id == visit_id).values(**changed))
        audit.record(
            c, actor, "programme.visit_changed", "patient", row.patient_id,
            {"visit": row.label, "fields": sorted(changed), "session_id": changed.get("session_id")},
        )  # fmt: skip
    return get(c, row.programme_id)


def end(c: Connection, actor: audit.Actor | None, programme_id: str) -> None:
    """Remove a programme and its plan, but not its sessions; raises NotFound."""
    current = get(c, programme_id)
    c.execute(delete(planned_visit).where(planned_visit.c.programme_id == programme_id))
    c.execute(delete(programme).where(programme.c.id == programme_id))
    detail = {"programme_id": programme_id, "done": current.count("done"), "visits": len(current.visits)}
    audit.record(c, actor, "programme.ended", "patient", current.patient_id, detail)


def visit_of(c: Connection, session_id: str) -> PlannedVisit | None:
    """The planned visit linked to a session."""
    row = c.execute(_VISITS.where(planned_visit.c.session_id == session_id)).first()
    return None if row is None else _planned(row)


def _visit(c: Connection, visit_id: str) -> Any:
    query = select(planned_visit, programme.c.patient_id).join(
        programme, programme.c.id == planned_visit.c.programme_id
    )
    row = c.execute(query.where(planned_visit.c.id == visit_id)).first()
    if row is None:
        raise NotFound("planned visit", visit_id)
    return row


def _check_session(c: Connection, row: Any, session_id: str) -> None:
    if sessions.get(c, session_id).patient_id != row.patient_id:
        raise Conflict("other_patient", "This visit belongs to another patient.")
    if row.session_id not in {None, session_id}:
        raise Conflict(
            "visit_taken", Message("{label} already has a visit; unlink it first.", label=row.label)
        )
    linked = visit_of(c, session_id)
    if linked is not None and linked.id != row.id:
        raise Conflict(
            "session_planned",
            Message("This visit is already {label}; unlink it there first.", label=linked.label),
        )


_VISITS = select(planned_visit, session.c.performed_on).join(
    session, session.c.id == planned_visit.c.session_id, isouter=True
)


def _planned(row: Any) -> PlannedVisit:
    names = ("id", "label", "kind", "week", "planned_on", "session_id", "performed_on")
    visit = PlannedVisit(**{name: getattr(row, name) for name in names}, state="planned")
    return visit if visit.session_id is None else replace(visit, state="done")


def _programmes(c: Connection, which: ColumnElement[bool]) -> list[Programme]:
    """Programmes with their visits in one statement, newest first; each starts with its first visit."""
    theirs = _VISITS.add_columns(*(programme.c[name].label(f"of_{name}") for name in _OWN))
    query = theirs.join(programme, programme.c.id == planned_visit.c.programme_id).where(which)
    rows = c.execute(query.order_by(programme.c.starts_on.desc(), programme.c.id, planned_visit.c.position))
    today = now().date()
    result = []
    for _, group in itertools.groupby(rows, key=lambda row: row.programme_id):
        planned = list(group)
        own = {name: getattr(planned[0], f"of_{name}") for name in _OWN}
        visits = judge_states(tuple(_planned(row) for row in planned), today)
        result.append(Programme(**own, words=COURSES[own["template"]].words, visits=visits))
    return result


_OWN = ("id", "patient_id", "template", "starts_on", "created_at")


def judge_states(visits: tuple[PlannedVisit, ...], today: dt.date) -> tuple[PlannedVisit, ...]:
    """Determine the state of each visit: done, missed, next or planned; in order of date."""
    result: list[PlannedVisit] = []
    ahead = False
    for visit in sorted(visits, key=lambda v: v.planned_on):
        if visit.session_id is not None:
            result.append(replace(visit, state="done"))
        elif visit.planned_on < today:
            result.append(replace(visit, state="missing"))
        else:
            result.append(replace(visit, state="planned" if ahead else "next"))
            ahead = True
    return tuple(result)
