"""All analysed visits of a patient with current results, for trends under the same walking condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

from sqlalchemy import Connection

from sagittal.core.norms import Norms, NormValue, look_up_norms, temporal_values
from sagittal.core.subject.condition import WalkingCondition, is_alike
from sagittal.server.clinic import programmes, sessions
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.programmes import Programme
from sagittal.server.clinic.sessions import Session
from sagittal.server.errors import NotFound
from sagittal.server.report.history import daily_trend
from sagittal.server.report.history.daily_trend import CapacityVisit, PerformanceDay
from sagittal.server.report.history.numbers import Numbers
from sagittal.server.report.history.trends import AnalysedVisit, VisitKind
from sagittal.server.results import analyses, edit_log
from sagittal.server.results.reviewed import ReviewedAnalyses


@dataclass(frozen=True, eq=False)
class PatientHistory:
    """Comparable visits of a patient.

    Parameters
    ----------
    condition : common walking condition, possibly with feedback; None without a visit.
    visits : analysed, oldest first. others : visits under other conditions. programmes : newest first.
    """

    patient: Patient
    condition: WalkingCondition | None
    visits: tuple[AnalysedVisit, ...]
    others: tuple[OtherWalks, ...]
    programmes: tuple[Programme, ...]

    @cached_property
    def norms(self) -> tuple[Norms, ...]:
        """Norms for the patient at each visit, at its gait speed."""
        return tuple(self._find_norms(visit.numbers) for visit in self.visits)

    def _find_norms(self, numbers: Numbers) -> Norms:
        speed = next((p.mean for p in numbers.parameters if p.name == "gait_speed_mps"), None)
        belt = self.condition is not None and self.condition.protocol == "treadmill"
        return look_up_norms(
            self._age,
            self.patient.sex,
            speed,
            self.patient.height_m,
            treadmill=belt,
            contacts_s=numbers.contacts_s,
        )

    @property
    def usual(self) -> dict[str, NormValue]:
        """Norms for the patient's age and sex at comfortable gait speed."""
        return dict(temporal_values(self._age, self.patient.sex).values)

    @property
    def _age(self) -> int | None:
        return self.patient.find_age(self.visits[-1].performed_on) if self.visits else None


@dataclass(frozen=True)
class OtherWalks:
    """Analysed visits under another condition: their number and the newest one."""

    condition: WalkingCondition
    count: int
    session_id: str


@dataclass(frozen=True)
class AnalysedSession:
    """A session with its current analysis and edits."""

    session: Session
    found: analyses.AnalysisRecord
    edits: edit_log.EditHistory

    @property
    def condition(self) -> WalkingCondition:
        """Walking condition."""
        return self.session.walked(_belt(self.found.manifest))


def list_analysed(c: Connection, patient_id: str) -> list[AnalysedSession]:
    """Sessions of a patient with a result, oldest first."""
    patient_sessions = sessions.of_patient(c, patient_id)
    records = analyses.latest_of(c, [s.id for s in patient_sessions])
    edits = edit_log.edits_of_all(c, [record.id for record in records.values()])
    return [
        AnalysedSession(s, record, edits[record.id])
        for s in reversed(patient_sessions)
        if (record := records.get(s.id)) is not None
    ]


def baseline(done: Sequence[AnalysedSession]) -> AnalysedSession | None:
    """The newest visit representative of the patient's gait, if possible at comfortable pace.

    Visits with feedback are excluded. Tests and squats are used only if there is no walk overground or on a
    treadmill, daily life only if there is nothing else.

    Parameters
    ----------
    done : oldest first.
    """
    untold = [a for a in reversed(done) if not a.session.feedback]
    walks = [a for a in untold if a.session.protocol in sessions.WALKS]
    untold = walks or [a for a in untold if a.session.protocol != "activity"] or untold
    return next((a for a in untold if a.condition.is_at_own_pace), untold[0] if untold else None)


def read_history(
    reviewed: ReviewedAnalyses,
    patient: Patient,
    done: Sequence[AnalysedSession],
    plans: Sequence[Programme],
    protocol: str | None = None,
    like: str | None = None,
) -> PatientHistory:
    """Read the results of the visits under one condition; raises IntegrityError, NotFound.

    Parameters
    ----------
    protocol : only visits with this protocol. like : use the condition of this session; None = of `baseline`,
        otherwise of the newest visit.
    """
    candidates = [a for a in done if protocol in {None, a.session.protocol}]
    if like is None:
        chosen = baseline(candidates) or (candidates[-1] if candidates else None)
    else:
        chosen = next((a for a in done if a.session.id == like), None)
        if chosen is None:
            raise NotFound("analysed visit of this patient", like)
    planned = {v.session_id: v for plan in plans for v in plan.visits if v.session_id is not None}
    visits = []
    for a in candidates:
        if chosen is None or not is_alike(a.condition, chosen.condition):
            continue
        plan = planned.get(a.session.id)
        label = None if plan is None else plan.label
        kind = classify_visit(a.session, None if plan is None else plan.kind)
        visits.append(read_visit(reviewed, a, kind, label))
    listed = {v.session_id for v in visits}
    unlisted = [a for a in done if a.session.id not in listed]
    condition = None if chosen is None else replace(chosen.condition, feedback=False)
    return PatientHistory(patient, condition, tuple(visits), _others(unlisted), tuple(plans))


def read_visit(
    reviewed: ReviewedAnalyses, a: AnalysedSession, kind: VisitKind, label: str | None = None
) -> AnalysedVisit:
    """Read the current results of a visit; raises IntegrityError. `kind`, `label` : as in AnalysedVisit."""
    return AnalysedVisit(
        a.session.id,
        a.session.performed_on,
        a.session.title,
        label,
        kind,
        a.condition,
        reviewed.read_numbers(a.found, a.edits),
    )


def read_performance(reviewed: ReviewedAnalyses, done: Sequence[AnalysedSession]) -> list[PerformanceDay]:
    """Read the days of all daily-life recordings, oldest first; raises IntegrityError."""

    def read(a: AnalysedSession) -> list[PerformanceDay]:
        daily = reviewed.read_bundle(a.found, a.edits).activity
        if daily is None:
            return []
        return daily_trend.read_performance(a.session.id, a.session.performed_on, daily)

    days: list[PerformanceDay] = []
    for a in done:
        if a.session.protocol == "activity":
            days += reviewed.keep_part((a.found.id, "performance"), partial(read, a))
    return sorted(days, key=lambda d: d.day)


def read_capacity(history: PatientHistory) -> list[CapacityVisit]:
    """Walking capacity from the walks of a history, oldest first, excluding daily life."""
    capacities = (
        daily_trend.read_capacity(v.session_id, v.performed_on, v.title, v.numbers.parameters)
        for v in history.visits
        if v.condition.protocol != "activity"
    )
    return [v for v in capacities if v is not None]


def classify_visit(session: Session, planned: VisitKind | None) -> VisitKind:
    """Type of a visit: a walk with feedback is always a training."""
    if session.feedback:
        return "training"
    return planned or "assessment"


def _others(unlisted: Sequence[AnalysedSession]) -> tuple[OtherWalks, ...]:
    """Visits by condition, in order of the newest."""
    groups: list[list[AnalysedSession]] = []
    for a in reversed(unlisted):
        alike = next((g for g in groups if is_alike(g[0].condition, a.condition)), None)
        if alike is None:
            groups.append([a])
        else:
            alike.append(a)
    return tuple(OtherWalks(replace(g[0].condition, feedback=False), len(g), g[0].session.id) for g in groups)


def _belt(manifest: Mapping[str, Any] | None) -> float | None:
    speed = (manifest or {}).get("belt_speed_mps")
    return None if speed is None else float(speed)


def read(c: Connection, patient: Patient) -> tuple[list[AnalysedSession], list[programmes.Programme]]:
    """Read everything `read_history` requires from the database."""
    return list_analysed(c, patient.id), programmes.of_patient(c, patient.id)
