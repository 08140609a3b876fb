"""Patients by pseudonym: create, update, search; for erasure see server/safekeeping/erasure.py."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal
from unicodedata import normalize

from sqlalchemy import Connection, Select, bindparam, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from sagittal.core.frames import Side
from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.sight import TEAMS_ARE_ON, only_seen
from sagittal.server.clinic import jobs
from sagittal.server.errors import Conflict, NotFound, ServiceError
from sagittal.server.jobs.queue import BESIDE
from sagittal.server.storage.schema.columns import make_all
from sagittal.server.storage.schema.tables import ACTIVE_STATES, job, new_id, now, patient, recording, session

if TYPE_CHECKING:
    from sagittal.server.clinic.sessions import Session

CHANGEABLE = frozenset({"code", "sex", "birth_year", "height_m", "affected_side", "is_control", "note"})


@dataclass(frozen=True)
class Patient:
    """A patient, with a summary of the visits for lists.

    Parameters
    ----------
    code : the clinic's pseudonym, unique. sex : female, male or None. height_m : metres or None.
    affected_side : left, right, or None for none or both. is_control : healthy, and consented to serve as a
        reference in this clinic.
    sessions : number of visits. last_visit : date of the latest, None without one.
    running : a job of one of the visits is queued or running.
    """

    id: str
    code: str
    sex: Literal["female", "male"] | None
    birth_year: int | None
    height_m: float | None
    affected_side: Side | None
    is_control: bool
    note: str
    created_at: dt.datetime
    sessions: int
    last_visit: dt.date | None
    running: bool

    def find_age(self, day: dt.date) -> int | None:
        """Age in years from the year of birth, None if unknown."""
        return day.year - self.birth_year if self.birth_year else None

    def find_height(self, session: Session) -> float | None:
        """Height in metres as measured at a visit, otherwise the patient's usual height."""
        return session.height_m if session.height_m is not None else self.height_m


@dataclass(frozen=True)
class PatientList:
    """Patients of a list and the counts shown with it.

    Parameters
    ----------
    total : patients that the user may open. active_jobs : their queued and running jobs.
    teams_on : the clinic has care teams.
    """

    patients: list[Patient]
    total: int
    active_jobs: int
    teams_on: bool


class CodeTaken(Conflict):
    """Another patient (None = unknown) has this code or a confusable one.

    The message repeats the code as typed: its exact spelling would open that patient in an emergency.
    """

    def __init__(self, code: str, patient_id: str | None) -> None:
        super().__init__(
            "code_taken",
            Message("The code '{code}' belongs to another patient; choose a new one.", code=code),
        )
        self.patient_id = patient_id


def create(
    c: Connection,
    actor: audit.Actor | None,
    *,
    code: str,
    sex: str | None = None,
    birth_year: int | None = None,
    height_m: float | None = None,
    affected_side: Side | None = None,
    is_control: bool = False,
    note: str = "",
) -> Patient:
    """Add a patient; raises CodeTaken, ServiceError bad_value."""
    patient_id = new_id()
    values = {
        "code": code,
        "sex": sex,
        "birth_year": birth_year,
        "height_m": height_m,
        "affected_side": affected_side,
        "is_control": is_control,
        "note": note,
    }
    checked = _checked(values)
    _refuse_alike(c, str(checked["code"]))
    with _explained(code):
        c.execute(insert(patient).values(id=patient_id, created_at=now(), **checked))
    audit.record(c, actor, "patient.created", "patient", patient_id)
    return get(c, patient_id)


def change(
    c: Connection, actor: audit.Actor | None, patient_id: str, values: Mapping[str, object]
) -> Patient:
    """Update some of CHANGEABLE; raises NotFound, CodeTaken, ServiceError bad_value."""
    previous = get(c, patient_id)
    checked = _checked(values)
    changed = {name: value for name, value in checked.items() if getattr(previous, name) != value}
    if "code" in changed:
        _refuse_alike(c, str(changed["code"]), patient_id)
    if changed:
        with _explained(str(changed.get("code"))):
            c.execute(update(patient).where(patient.c.id == patient_id).values(**changed))
        audit.record(c, actor, "patient.changed", "patient", patient_id, {"fields": sorted(changed)})
    return get(c, patient_id)


def get(c: Connection, patient_id: str) -> Patient:
    """One patient; raises NotFound."""
    row = c.execute(_one(), {"one_id": patient_id}).first()
    if row is None:
        raise NotFound("patient", patient_id)
    return Patient(**row._asdict())


def count(c: Connection, user: Identity | None) -> int:
    """Number of patients that a user may open; None = the system, all."""
    return int(c.execute(_count(user)).scalar_one())


def _count(user: Identity | None) -> Select[Any]:
    return only_seen(select(func.count()).select_from(patient), user)


def list_patients(
    c: Connection, user: Identity | None, *, search: str = "", limit: int = 200, offset: int = 0
) -> list[Patient]:
    """Patients whose code or note contains `search` (case-insensitive), latest visit first.

    Parameters
    ----------
    user : only those accessible to this user; None = the system, which sees all.
    """
    return make_all(Patient, c.execute(_search(user, search).limit(limit).offset(offset)))


def list_counted(c: Connection, user: Identity, *, search: str = "", limit: int = 200) -> PatientList:
    """Patients with the counts shown with the list, in one statement (two if none match)."""
    counts = [
        _count(user).correlate(None).scalar_subquery(),
        jobs.select_active_count(user).correlate(None).scalar_subquery(),
        TEAMS_ARE_ON,
    ]
    named = [x.label(f"count_{i}") for i, x in enumerate(counts)]
    result = c.execute(_search(user, search).add_columns(*named).limit(limit))
    names = tuple(result.keys())[: -len(named)]
    rows = result.all()
    total, active, teams_on = rows[0][-len(named) :] if rows else c.execute(select(*named)).one()
    matching = [Patient(**dict(zip(names, row, strict=False))) for row in rows]
    return PatientList(matching, total, active, bool(teams_on))


def _search(user: Identity | None, search: str) -> Select[Any]:
    query = only_seen(_listing(), user).order_by(
        _LAST_VISIT.desc().nulls_last(), patient.c.created_at.desc(), patient.c.id
    )
    if search.strip():
        text = search.strip()
        query = query.where(
            patient.c.code.icontains(text, autoescape=True) | patient.c.note.icontains(text, autoescape=True)
        )
    return query


def list_older(c: Connection, day: dt.date) -> list[Patient]:
    """Patients whose latest visit, or creation if none, is before a date; oldest first."""
    added = dt.datetime.combine(day, dt.time(), dt.UTC)
    is_older = (day > _LAST_VISIT) | (_LAST_VISIT.is_(None) & (patient.c.created_at < added))
    query = _listing().where(is_older).order_by(_LAST_VISIT.nulls_first(), patient.c.created_at, patient.c.id)
    return make_all(Patient, c.execute(query))


_LAST_VISIT = (
    select(func.max(session.c.performed_on))
    .where(session.c.patient_id == patient.c.id)
    .correlate(patient)
    .scalar_subquery()
)


@cache
def _listing() -> Select[Any]:
    visits = (
        select(func.count())
        .select_from(session)
        .where(session.c.patient_id == patient.c.id)
        .correlate(patient)
        .scalar_subquery()
    )
    # one query for all patients: per patient, it would scan all queued jobs each time
    running = patient.c.id.in_(
        select(session.c.patient_id)
        .join(recording, recording.c.session_id == session.c.id)
        .join(job, job.c.recording_id == recording.c.id)
        .where(job.c.state.in_(ACTIVE_STATES), job.c.kind.not_in(BESIDE))
        .correlate(None)
    )
    return select(
        patient, visits.label("sessions"), _LAST_VISIT.label("last_visit"), running.label("running")
    )


@cache
def _one() -> Select[Any]:
    return _listing().where(patient.c.id == bindparam("one_id"))


def _checked(values: Mapping[str, object]) -> dict[str, Any]:
    unknown = values.keys() - CHANGEABLE
    if unknown:
        raise ServiceError("bad_value", Message("A patient has no {join}.", join=", ".join(sorted(unknown))))
    checked = dict(values)
    if "code" in checked:
        code = normalize("NFKC", str(checked["code"])).strip()
        if not 1 <= len(code) <= 64:
            raise ServiceError("bad_value", "A patient's code has 1 to 64 characters.")
        checked["code"] = code
    born, year = checked.get("birth_year"), now().year
    if isinstance(born, int) and born > year:
        raise ServiceError(
            "bad_value",
            Message("The year of birth is {born}. Expected {year} or earlier.", born=born, year=year),
        )
    return checked


def _refuse_alike(c: Connection, code: str, own: str | None = None) -> None:
    """Raise CodeTaken if another code differs only in case or in the Unicode form of letters."""
    for other_id, existing_code in c.execute(select(patient.c.id, patient.c.code)):
        if other_id != own and normalize("NFKC", existing_code).casefold() == code.casefold():
            raise CodeTaken(code, other_id)


class _explained:  # noqa: N801 - reads as a word: with _explained(code)
    """Convert integrity errors of the database to CodeTaken or ServiceError."""

    def __init__(self, code: str) -> None:
        self._code = code

    def __enter__(self) -> None:
        """No preparation necessary."""

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if not isinstance(error, IntegrityError):
            return
        if "code" in str(error.orig) and "UNIQUE" in str(error.orig).upper():
            raise CodeTaken(self._code, None) from error
        raise ServiceError(
            "bad_value",
            "Expected sex female, male or none, a year of birth from 1850, a height of 0.5 to 2.5 m. "
            "Expected an affected side left, right or none.",
        ) from error
