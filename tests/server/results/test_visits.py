"""Trials that form a visit, the comparison visit, and the latest speed of a list."""

from __future__ import annotations

import datetime as dt
from typing import Any

import pytest

from sagittal.core.subject.condition import WalkingCondition
from sagittal.server.clinic.sessions import Session, WalkedSession
from sagittal.server.report.history.trends import VisitKind
from sagittal.server.results.analyses import AnalysisRecord
from sagittal.server.results.edit_log import EditHistory
from sagittal.server.results.histories import AnalysedSession, list_analysed
from sagittal.server.results.visits import (
    ClinicVisit,
    _two_days,
    choose_newest_walks,
    find_before,
    find_visit_of,
    group_takes,
    is_one_visit,
    measure_visit,
    read_newest_speeds,
)
from tests.helpers.clinic import Clinic
from tests.server import feedback

DAY = dt.date(2026, 3, 2)


def take(name: str, days: int = 0, minute: int = 0, **walked: Any) -> AnalysedSession:
    known_fields: dict[str, Any] = {
        "pace": None, "aid": None, "orthosis": None, "shoes": None, "feedback": False, "protocol": "walk"
    }  # fmt: skip
    position = dt.datetime(2026, 3, 2, 9, minute, tzinfo=dt.UTC) + dt.timedelta(days=days)
    session = Session(
        id=name, patient_id="p", patient_code="P-1", title=name, performed_on=DAY + dt.timedelta(days=days),
        height_m=None, note="", created_at=position, has_video=False, state="done", **(known_fields | walked),
    )  # fmt: skip
    analysis_record = AnalysisRecord(
        f"analysis of {name}", "r", name, "p", "j", "", "", "1", None, {}, position, {}
    )
    return AnalysedSession(session, analysis_record, EditHistory())


def names(result: list[ClinicVisit]) -> list[list[str]]:
    return [[t.session.id for t in v.takes] for v in result]


def test_takes_of_one_day_that_were_walked_alike_are_one_visit_in_the_order_they_were_made() -> None:
    done = [take("c", 1), take("b", minute=5), take("fast", minute=3, pace="fast"), take("a", minute=1)]
    assert names(group_takes(done)) == [["a", "b"], ["fast"], ["c"]]
    assert group_takes([]) == []
    (visit,) = group_takes([take("x", 2)])
    assert (visit.day, visit.condition) == (DAY + dt.timedelta(days=2), WalkingCondition())


def test_a_take_with_feedback_is_a_visit_of_its_own() -> None:
    plain, trial = take("a"), take("b", minute=1, feedback=True)
    assert not is_one_visit(plain, trial)
    assert is_one_visit(trial, take("c", minute=2, feedback=True))
    assert not is_one_visit(plain, take("d", 1))


def test_a_visit_is_found_by_any_of_its_takes() -> None:
    done = [take("a"), take("b", minute=1), take("c", 1)]
    visit = find_visit_of(done, "b")
    assert visit is not None
    assert names([visit]) == [["a", "b"]]
    assert find_visit_of(done, "none") is None


def before(name: str, planned: dict[str, VisitKind], *done: AnalysedSession) -> str | None:
    takes = group_takes(done)
    visit = next(v for v in takes if v.takes[0].session.id == name)
    earlier = find_before(takes, visit, planned)
    return None if earlier is None else earlier.takes[0].session.id


def test_a_visit_is_compared_with_the_last_day_before_it_in_the_same_condition() -> None:
    done = [
        take("old"),
        take("mid", 3),
        take("fast", 5, pace="fast"),
        take("told", 6, feedback=True),
        take("new", 7),
    ]
    assert before("new", {}, *done) == "mid"
    assert before("mid", {}, *done) == "old"
    assert before("old", {}, *done) is None
    assert before("fast", {}, *done) is None


def test_an_assessment_is_compared_with_an_assessment_and_a_training_with_either() -> None:
    done = [take("pre"), take("t1", 3), take("t2", 5), take("post", 7)]
    planned: dict[str, VisitKind] = {
        "pre": "assessment",
        "t1": "training",
        "t2": "training",
        "post": "assessment",
    }
    assert before("post", planned, *done) == "pre"
    assert before("t2", planned, *done) == "t1"


def walk(name: str, days: int, **condition: Any) -> WalkedSession:
    return WalkedSession(name, DAY + dt.timedelta(days=days), WalkingCondition(**condition))


def test_of_a_list_the_newest_day_and_the_one_before_it_are_read() -> None:
    newest = walk("new", 7)
    mine = [
        newest,
        walk("same day", 7),
        walk("fast", 6, pace="fast"),
        walk("a", 3),
        walk("b", 3),
        walk("old", 1),
    ]
    assert [w.id for w in _two_days(mine, newest, {})] == ["new", "same day", "a", "b"]
    trainings: dict[str, VisitKind] = {"a": "training", "b": "training"}
    assert [w.id for w in _two_days(mine, newest, trainings)] == ["new", "same day", "old"]
    assert [w.id for w in _two_days(mine, newest, trainings | {"new": "training"})][2:] == ["a", "b"]


def test_speeds_of_a_list_are_of_the_newest_visit_with_its_change(stored: Clinic) -> None:
    patient, other_patient = feedback.person(stored), feedback.person(stored)
    sessions = [feedback.walked(stored, patient, days, 12.0) for days in (0, 7)]
    feedback.walked(stored, patient, 9, 12.0, pace="fast")
    with stored.db.read() as c:
        chosen = choose_newest_walks(c, [patient, other_patient], {})
        done = list_analysed(c, patient)
    assert list(chosen) == [patient]
    assert [w.id for w in chosen[patient]] == sessions[::-1]
    visible_by_id = {a.session.id: a.found for a in done}
    edits = {a.found.id: a.edits for a in done}
    reviewed = stored.app.state.reviewed
    speed = read_newest_speeds(reviewed, chosen, visible_by_id, edits)[patient]
    assert speed.mean.mean == pytest.approx(1.2, abs=0.2)
    assert speed.change is not None
    first = read_newest_speeds(reviewed, {patient: chosen[patient][:1]}, visible_by_id, edits)[patient]
    assert first.change is None
    # of the newest day nothing can be read: there is no newest speed
    gone = {
        **visible_by_id,
        sessions[1]: visible_by_id[sessions[0]].__class__(
            **{**vars(visible_by_id[sessions[1]]), "files": {}}
        ),
    }
    assert read_newest_speeds(reviewed, chosen, gone, edits) == {}


def test_figures_of_a_visit_are_means_over_its_takes(stored: Clinic) -> None:
    patient = feedback.person(stored)
    pair = [feedback.walked(stored, patient, 0, duration) for duration in (12.0, 24.0)]
    with stored.db.read() as c:
        (visit,) = group_takes(list_analysed(c, patient))
    result = measure_visit(stored.app.state.reviewed, visit)
    cadence = result["cadence_spm", None]
    assert list(cadence.by_take) == pair
    single = [p.mean for p in cadence.takes]
    assert cadence.mean.mean == pytest.approx(sum(m or 0.0 for m in single) / 2, rel=0.01)
    assert cadence.mean.n == sum(p.n for p in cadence.takes)
