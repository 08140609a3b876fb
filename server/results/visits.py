"""Visits: the trials of one day under one condition, and their mean."""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from sqlalchemy import Connection

from sagittal.core.change import Change, parameter_changes
from sagittal.core.frames import Side
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.takes import join_takes
from sagittal.core.subject.condition import WalkingCondition, is_alike, is_comparable
from sagittal.server.clinic import sessions
from sagittal.server.report.history.trends import VisitKind
from sagittal.server.results import analyses, edit_log
from sagittal.server.results.histories import AnalysedSession, classify_visit
from sagittal.server.results.reviewed import UNREADABLE, ReviewedAnalyses

SPEED: Final = "gait_speed_mps"


@dataclass(frozen=True, eq=False)
class ClinicVisit:
    """The analysed trials of one day under the same condition, in order of recording; at least one."""

    takes: tuple[AnalysedSession, ...]

    @property
    def day(self) -> dt.date:
        """Date of the visit."""
        return self.takes[0].session.performed_on

    @property
    def condition(self) -> WalkingCondition:
        """Walking condition of all its trials."""
        return self.takes[0].condition


@dataclass(frozen=True)
class TakesFigure:
    """A parameter of a visit.

    Parameters
    ----------
    by_take : session of every trial with a value → value. mean : over them.
    """

    by_take: Mapping[str, Parameter]
    mean: Parameter

    @property
    def takes(self) -> tuple[Parameter, ...]:
        """Values of the trials, in order of recording."""
        return tuple(self.by_take.values())


@dataclass(frozen=True)
class NewestSpeed:
    """Gait speed at a patient's newest visit, and its change since the previous visit, None = none yet."""

    mean: Parameter
    change: Change | None


def group_takes(done: Sequence[AnalysedSession]) -> list[ClinicVisit]:
    """Group trials of one day under the same condition; visits and trials oldest first."""
    groups: list[list[AnalysedSession]] = []
    for a in sorted(done, key=lambda a: (a.session.performed_on, a.session.created_at)):
        same = next((g for g in reversed(groups) if is_one_visit(g[0], a)), None)
        if same is None:
            groups.append([a])
        else:
            same.append(a)
    return [ClinicVisit(tuple(g)) for g in groups]


def is_one_visit(a: AnalysedSession, b: AnalysedSession) -> bool:
    """Whether two trials belong to the same visit: same day and condition, both with or without feedback."""
    return (
        a.session.performed_on == b.session.performed_on
        and a.session.feedback == b.session.feedback
        and is_alike(a.condition, b.condition)
    )


def find_visit_of(done: Sequence[AnalysedSession], session_id: str) -> ClinicVisit | None:
    """The visit that includes a session; None if it is not analysed."""
    return next(
        (v for v in group_takes(done) if any(t.session.id == session_id for t in v.takes)),
        None,
    )


def measure_visit(
    reviewed: ReviewedAnalyses, visit: ClinicVisit
) -> Mapping[tuple[str, Side | None], TakesFigure]:
    """All parameters of a visit by name and side; raises IntegrityError."""
    by_parameter: dict[tuple[str, Side | None], dict[str, Parameter]] = {}
    for take in visit.takes:
        for p in reviewed.read_numbers(take.found, take.edits).parameters:
            by_parameter.setdefault((p.name, p.side), {})[take.session.id] = p
    return {
        key: TakesFigure(by_take, join_takes(list(by_take.values()))) for key, by_take in by_parameter.items()
    }


def find_before(
    visits: Sequence[ClinicVisit], visit: ClinicVisit, planned: Mapping[str, VisitKind]
) -> ClinicVisit | None:
    """The visit used for comparison: the last on an earlier day under the same condition.

    For an assessment it is the last assessment, so that a single training does not influence the trend.

    Parameters
    ----------
    visits : oldest first. planned : session → kind of its planned visit.
    """
    is_assessment = _is_assessment(visit, planned)
    for v in reversed(visits):
        if v.day >= visit.day or not is_comparable(v.condition, visit.condition):
            continue
        if is_assessment and not _is_assessment(v, planned):
            continue
        return v
    return None


def _is_assessment(visit: ClinicVisit, planned: Mapping[str, VisitKind]) -> bool:
    return any(classify_visit(t.session, planned.get(t.session.id)) == "assessment" for t in visit.takes)


def choose_newest_walks(
    c: Connection, patient_ids: Collection[str], planned: Mapping[str, VisitKind]
) -> dict[str, list[sessions.WalkedSession]]:
    """Trials of each patient's newest visit and the one before, in a single statement for all.

    Parameters
    ----------
    planned : `programmes.list_kinds` of these patients.
    """
    rows = sessions.list_walks(c, patient_ids)
    chosen: dict[str, list[sessions.WalkedSession]] = {}
    for pid in patient_ids:
        mine = rows.get(pid, [])
        newest = next((w for w in mine if w.condition.is_at_own_pace), mine[0] if mine else None)
        if newest is not None:
            chosen[pid] = _two_days(mine, newest, planned)
    return chosen


def read_newest_speeds(
    reviewed: ReviewedAnalyses,
    chosen: Mapping[str, Sequence[sessions.WalkedSession]],
    records: Mapping[str, analyses.AnalysisRecord],
    edits: Mapping[str, edit_log.EditHistory],
) -> dict[str, NewestSpeed]:
    """Gait speed at the newest visit of each patient; unreadable ones are omitted.

    Parameters
    ----------
    chosen : result of `choose_newest_walks`. records : displayed analyses, by session.
    edits : by analysis.
    """
    speeds = {}
    for pid, walks in chosen.items():
        days: dict[dt.date, list[Parameter]] = {}
        for w in walks:
            record = records[w.id]
            speed = _read_speed(reviewed, record, edits[record.id])
            if speed is not None:
                days.setdefault(w.performed_on, []).append(speed)
        daily_means = [join_takes(days[day]) for day in sorted(days)]
        if daily_means and max(days) == walks[0].performed_on and daily_means[-1].mean is not None:
            previous = daily_means[0] if len(daily_means) > 1 else None
            change = None if previous is None else parameter_changes([previous], [daily_means[-1]])[0]
            speeds[pid] = NewestSpeed(daily_means[-1], change)
    return speeds


def _read_speed(
    reviewed: ReviewedAnalyses, record: analyses.AnalysisRecord, edits: edit_log.EditHistory
) -> Parameter | None:
    if "analysis.json" not in record.files:
        return None
    try:
        return reviewed.read_speed(record, edits)
    except UNREADABLE:
        return None


def _two_days(
    mine: Sequence[sessions.WalkedSession], newest: sessions.WalkedSession, planned: Mapping[str, VisitKind]
) -> list[sessions.WalkedSession]:
    """Trials of a visit and the one before, newest first."""
    alike = [w for w in mine if is_alike(w.condition, newest.condition)]
    is_training = planned.get(newest.id) == "training"
    earlier = [
        w
        for w in alike
        if w.performed_on < newest.performed_on and (is_training or planned.get(w.id) != "training")
    ]
    days = {newest.performed_on, *(w.performed_on for w in earlier[:1])}
    return [w for w in (newest, *(w for w in alike if w is not newest)) if w.performed_on in days]
