"""Selection of two sessions of a patient for comparison: any two with results, or one and its predecessor."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Connection

from sagittal.core.message import Message
from sagittal.core.norms import Norms, look_up_norms
from sagittal.core.subject.condition import compare_conditions, is_comparable
from sagittal.server.clinic import patients, programmes, sessions
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.errors import Conflict
from sagittal.server.report.history.comparison import ComparedRow, compare_rows
from sagittal.server.report.history.numbers import Numbers
from sagittal.server.report.history.trends import VisitKind
from sagittal.server.results import analyses, edit_log
from sagittal.server.results.histories import AnalysedSession, classify_visit
from sagittal.server.results.reviewed import ReviewedAnalyses


@dataclass(frozen=True)
class SessionPair:
    """Two analysed sessions of a patient, the earlier one first."""

    patient: Patient
    before: AnalysedSession
    after: AnalysedSession

    @property
    def comparable(self) -> bool:
        """Whether a difference can be attributed to the patient."""
        return is_comparable(self.before.condition, self.after.condition)

    @property
    def cautions(self) -> tuple[str, ...]:
        """Differences in walking condition or measurement that may explain a change, as sentences."""
        reasons: list[str] = []
        old, new = self.before, self.after
        if unlike := compare_conditions(old.condition, new.condition):
            reasons.append(
                Message(
                    "The conditions differ: {unlike}. Differences may be due to this and are not reported as "
                    "changes.",
                    unlike="; ".join(unlike),
                )
            )
        elif old.session.feedback:
            reasons.append("Both were walked with feedback, so differences are not reported as changes.")
        elif unstated := new.condition.unstated:
            reasons.append(
                Message(
                    "Not stated for either visit: {unstated}. Assumed to be the same.",
                    unstated=", ".join(unstated),
                )
            )
        if _sensors(old) != _sensors(new):
            reasons.append("The two visits used sensors on different segments.")
        if old.found.config_sha256 != new.found.config_sha256:
            reasons.append("The two analyses have different settings; run the earlier one again to compare.")
        elif old.found.code_version != new.found.code_version:
            reasons.append(
                Message(
                    "The analyses are of different versions ({code_version}, {code_version2}); run the "
                    "earlier one again to compare.",
                    code_version=old.found.code_version,
                    code_version2=new.found.code_version,
                )
            )
        return tuple(reasons)


def pair(c: Connection, session_id: str, other_id: str) -> SessionPair:
    """Two sessions to compare, given in any order.

    Raises
    ------
    NotFound: a session or its result. Conflict: other_patient, same_session.
    """
    if session_id == other_id:
        raise Conflict("same_session", "A visit cannot be compared with itself.")
    ends = [_analysed(c, sid) for sid in (session_id, other_id)]
    if ends[0].session.patient_id != ends[1].session.patient_id:
        raise Conflict("other_patient", "These visits belong to different patients.")
    ends.sort(key=lambda a: _moment(a.session))
    return SessionPair(patients.get(c, ends[0].session.patient_id), *ends)


def list_comparable(
    c: Connection, session: Session, done: Sequence[AnalysedSession]
) -> list[tuple[AnalysedSession, VisitKind]]:
    """Earlier analysed sessions comparable with a session, oldest first, followed by the session.

    All have the same walking condition. An assessment is compared with assessments only, so that a training
    does not influence the trend. Trials of one day under the same condition form one visit and are not
    compared with each other. Sessions with feedback are neither compared nor used for comparison. Empty if
    the session has no result.

    Parameters
    ----------
    done : the analysed sessions of the patient, oldest first (histories.list_analysed).
    """
    this = next((a for a in done if a.session.id == session.id), None)
    if this is None:
        return []
    planned = programmes.list_kinds(c, [session.patient_id])
    kind = classify_visit(session, planned.get(session.id))
    earlier = [
        (a, classify_visit(a.session, planned.get(a.session.id)))
        for a in done
        if is_comparable(a.condition, this.condition) and a.session.performed_on < session.performed_on
    ]
    return [*(e for e in earlier if kind == "training" or e[1] == "assessment"), (this, kind)]


def find_previous(c: Connection, session: Session, done: Sequence[AnalysedSession]) -> AnalysedSession | None:
    """The session that a session's table is compared with, from `list_comparable`; None = none."""
    return pick_previous(list_comparable(c, session, done))


def pick_previous(alike: Sequence[tuple[AnalysedSession, VisitKind]]) -> AnalysedSession | None:
    """The last but one of `list_comparable`; None = there is none."""
    return alike[-2][0] if len(alike) > 1 else None


def _moment(session: Session) -> tuple[dt.date, dt.datetime]:
    return session.performed_on, session.created_at


def compare_sessions(reviewed: ReviewedAnalyses, session_pair: SessionPair) -> tuple[ComparedRow, ...]:
    """Table of a comparison; raises IntegrityError."""
    old = reviewed.read_numbers(session_pair.before.found, session_pair.before.edits)
    new = reviewed.read_numbers(session_pair.after.found, session_pair.after.edits)
    norm_pair = pair_norms(
        session_pair.patient, (session_pair.before.session, old), (session_pair.after.session, new)
    )
    return compare_rows(
        old, new, norm_pair, session_pair.patient.affected_side, comparable=session_pair.comparable
    )


def pair_norms(
    patient: Patient, earlier: tuple[Session, Numbers], later: tuple[Session, Numbers]
) -> tuple[Norms, Norms]:
    """Norms for a patient at two sessions, each at its own gait speed."""
    return find_norms(patient, *earlier), find_norms(patient, *later)


def find_norms(patient: Patient, session: Session, numbers: Numbers) -> Norms:
    """Norms for a patient at a session's date and gait speed."""
    speed = next((p.mean for p in numbers.parameters if p.name == "gait_speed_mps"), None)
    age = patient.find_age(session.performed_on)
    height = patient.find_height(session)
    return look_up_norms(
        age,
        patient.sex,
        speed,
        height,
        treadmill=session.protocol == "treadmill",
        contacts_s=numbers.contacts_s,
    )


def _analysed(c: Connection, session_id: str) -> AnalysedSession:
    session = sessions.get(c, session_id)
    record = analyses.get_shown(c, session_id)
    return AnalysedSession(session, record, edit_log.edits_of(c, record.id))


def _sensors(a: AnalysedSession) -> frozenset[str]:
    mapped = (a.found.manifest or {}).get("sensors") or {}
    return frozenset(segment for segment in mapped.values() if segment)
