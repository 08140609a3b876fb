"""The clinic's own controls: healthy subjects who consented to serve as a reference."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sqlalchemy import Connection, bindparam, select

from sagittal.core.norms.controls import ControlGroup, ControlSession, control_group
from sagittal.core.subject.condition import WalkingCondition
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.results import analyses, edit_log
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.schema.tables import patient
from sagittal.server.storage.schema.tables import session as session_table

NEAR_MPS: Final = 0.2
"""Controls within this speed difference serve as reference: speed matters more than age
(docs/science/norms-and-scores.md, "Speed"); our choice of width, about one SD of comfortable speed.
"""


@dataclass(frozen=True)
class ControlVisit:
    """An analysed visit of a control subject."""

    person: str
    sex: str | None
    birth_year: int | None
    performed_on: dt.date
    found: analyses.AnalysisRecord
    edits: edit_log.EditHistory


def list_visits(c: Connection, this: Patient, session: Session) -> tuple[ControlVisit, ...]:
    """Unaided visits of controls with the protocol of a session, excluding the patient's own.

    Visits are not selected by pace here: `make_group` selects those with a similar gait speed.
    """
    values = {"this_id": this.id, "this_protocol": session.protocol}
    records = analyses.latest_of(c, _THEIRS, values)
    edits = edit_log.edits_of_all(c, [record.id for record in records.values()])
    return tuple(
        ControlVisit(row.code, row.sex, row.birth_year, row.performed_on, record, edits[record.id])
        for row in c.execute(_PEOPLE, values)
        if (record := records.get(row.id)) is not None
        and WalkingCondition(aid=row.aid, orthosis=row.orthosis, feedback=row.feedback).is_unaided
    )


_THEIRS: Final = (
    select(session_table.c.id)
    .join(patient, patient.c.id == session_table.c.patient_id)
    .where(
        patient.c.is_control,
        patient.c.id != bindparam("this_id"),
        session_table.c.protocol == bindparam("this_protocol"),
    )
)
_PEOPLE: Final = (
    select(
        *(session_table.c[name] for name in ("id", "performed_on", "aid", "orthosis", "feedback")),
        *(patient.c[name] for name in ("code", "sex", "birth_year")),
    )
    .join(patient, patient.c.id == session_table.c.patient_id)
    .where(session_table.c.id.in_(_THEIRS))
    .order_by(session_table.c.id)
)


def make_group(
    reviewed: ReviewedAnalyses, visits: Sequence[ControlVisit], speed_mps: float | None
) -> ControlGroup | None:
    """Controls with a gait speed similar to the patient's; None without any control or without a speed."""
    if not visits or speed_mps is None:
        return None
    near = (round(speed_mps - NEAR_MPS, 2), round(speed_mps + NEAR_MPS, 2))
    return control_group([_session(reviewed, v) for v in visits], speed_mps=near)


def _session(reviewed: ReviewedAnalyses, visit: ControlVisit) -> ControlSession:
    def read() -> ControlSession:
        means = reviewed.read_means(visit.found, visit.edits)
        age = None if visit.birth_year is None else float(visit.performed_on.year - visit.birth_year)
        return ControlSession(visit.person, age, visit.sex, means.parameters, means.curves)  # type: ignore[arg-type]

    return reviewed.keep_control(visit.found, visit.edits, read)
