"""A programme plans visits by its template and follows what takes place of them."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest
from sqlalchemy import select

from sagittal.server.clinic import patients, programmes, sessions
from sagittal.server.clinic.course import SIX_WEEKS
from sagittal.server.errors import Conflict, NotFound, ServiceError
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import erasure
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.schema.tables import audit, now, planned_visit

MONDAY = dt.date(2026, 3, 2)


def _patient(db: Database, code: str = "P-1") -> str:
    with db.write() as c:
        return patients.create(c, None, code=code).id


def _session(db: Database, patient: str, day: dt.date = MONDAY) -> str:
    with db.write() as c:
        return sessions.create(c, None, patient, performed_on=day).id


def test_the_six_weeks_have_three_trainings_a_week_and_rest_in_the_fourth() -> None:
    by_week: dict[int, list[str]] = {}
    for visit in SIX_WEEKS.visits:
        by_week.setdefault(visit.week, []).append(visit.label)
    assert by_week == {
        0: ["PRE"],
        1: ["T1", "T2", "T3"],
        2: ["T4", "T5", "T6"],
        3: ["T7", "T8", "T9"],
        4: ["MID"],
        5: ["T10", "T11", "T12"],
        6: ["T13", "T14", "T15"],
        7: ["T16", "T17", "T18"],
        8: ["POST1"],
        13: ["POST6"],
    }


def test_follow_ups_are_one_and_six_weeks_after_the_last_training() -> None:
    day = dict(zip((v.label for v in SIX_WEEKS.visits), SIX_WEEKS.days(MONDAY), strict=True))
    assert day["T1"] == MONDAY
    assert day["PRE"] == MONDAY - dt.timedelta(weeks=1)
    assert day["POST1"] - day["T18"] == dt.timedelta(weeks=1)
    assert day["POST6"] - day["T18"] == dt.timedelta(weeks=6)


def test_what_has_passed_is_missing_and_the_first_ahead_is_next(db: Database) -> None:
    patient = _patient(db)
    starts = now().date() - dt.timedelta(days=1)
    with db.write() as c:
        instance = programmes.start(c, None, patient, starts_on=starts)
    state = {v.label: v.state for v in instance.visits}
    assert (state["PRE"], state["T1"], state["T2"], state["T3"]) == ("missing", "missing", "next", "planned")
    assert instance.next is not None
    assert instance.next.label == "T2"


def test_a_linked_session_makes_its_visit_done_and_unlinking_takes_it_back(db: Database) -> None:
    patient = _patient(db)
    session = _session(db, patient, MONDAY + dt.timedelta(days=1))
    with db.write() as c:
        instance = programmes.start(c, None, patient, starts_on=MONDAY)
        first = next(v for v in instance.visits if v.label == "T1")
        linked = programmes.change_visit(c, None, first.id, {"session_id": session})
    done = next(v for v in linked.visits if v.label == "T1")
    assert (done.state, done.performed_on) == ("done", MONDAY + dt.timedelta(days=1))
    with db.write() as c:
        assert programmes.visit_of(c, session) is not None
        back = programmes.change_visit(c, None, first.id, {"session_id": None})
        actions = c.execute(select(audit.c.action, audit.c.detail).order_by(audit.c.seq)).all()
    assert back.count("done") == 0
    changed = [row.detail for row in actions if row.action == "programme.visit_changed"]
    assert [d["session_id"] for d in changed] == [session, None]


def test_a_visit_and_a_session_belong_to_each_other_alone(db: Database) -> None:
    patient, stranger = _patient(db), _patient(db, "P-2")
    one, two, foreign = _session(db, patient), _session(db, patient), _session(db, stranger)
    with db.write() as c:
        instance = programmes.start(c, None, patient, starts_on=MONDAY)
        first, second = instance.visits[0].id, instance.visits[1].id
        programmes.change_visit(c, None, first, {"session_id": one})
        for visit, session, code in (
            (first, two, "visit_taken"),
            (second, one, "session_planned"),
            (second, foreign, "other_patient"),
        ):
            with pytest.raises(Conflict) as refused:
                programmes.change_visit(c, None, visit, {"session_id": session})
            assert refused.value.code == code


def test_two_programmes_of_a_patient_do_not_overlap(db: Database) -> None:
    patient = _patient(db)
    with db.write() as c:
        first = programmes.start(c, None, patient, starts_on=MONDAY)
        with pytest.raises(Conflict, match="until 2026-05-29"):
            programmes.start(c, None, patient, starts_on=first.ends_on)
        later = programmes.start(c, None, patient, starts_on=first.ends_on + dt.timedelta(days=8))
        assert [p.id for p in programmes.of_patient(c, patient)] == [later.id, first.id]


def test_a_programme_ends_without_its_sessions(db: Database) -> None:
    patient = _patient(db)
    session = _session(db, patient)
    with db.write() as c:
        instance = programmes.start(c, None, patient, starts_on=MONDAY)
        programmes.change_visit(c, None, instance.visits[1].id, {"session_id": session})
        programmes.end(c, None, instance.id)
        assert sessions.get(c, session).id == session
        with pytest.raises(NotFound):
            programmes.get(c, instance.id)


def test_erasing_a_session_opens_its_visit_again_and_erasing_the_patient_leaves_no_plan(
    db: Database, tmp_path: Path
) -> None:
    settings = Settings(data_dir=tmp_path)
    blobs = FolderBlobs(settings.blobs)
    patient = _patient(db)
    session = _session(db, patient)
    with db.write() as c:
        instance = programmes.start(c, None, patient, starts_on=MONDAY)
        programmes.change_visit(c, None, instance.visits[1].id, {"session_id": session})
    erasure.erase_session(db, ReviewedAnalyses(blobs), settings, None, session)
    with db.read() as c:
        assert programmes.get(c, instance.id).count("done") == 0
    erasure.erase_patient(db, ReviewedAnalyses(blobs), settings, None, patient, confirm="P-1")
    with db.read() as c:
        assert c.execute(select(planned_visit)).first() is None


def test_a_session_is_offered_for_the_open_visit_next_to_its_day(db: Database) -> None:
    patient = _patient(db)
    session = _session(db, patient)
    with db.write() as c:
        instance = programmes.start(c, None, patient, starts_on=MONDAY)
        near = instance.near(MONDAY + dt.timedelta(days=1))
        assert near is not None
        assert near.label in {"T1", "T2"}
        linked = programmes.change_visit(c, None, near.id, {"session_id": session})
    assert linked.near(MONDAY) != near
    assert instance.near(MONDAY + dt.timedelta(days=70)) is None


def test_nonsense_is_refused_with_a_sentence(db: Database) -> None:
    patient = _patient(db)
    with db.write() as c:
        with pytest.raises(ServiceError, match="six_weeks"):
            programmes.start(c, None, patient, starts_on=MONDAY, template="ten_years")
        with pytest.raises(ServiceError, match="check the year"):
            programmes.start(c, None, patient, starts_on=dt.date.min)
        instance = programmes.start(c, None, patient, starts_on=MONDAY)
        with pytest.raises(ServiceError, match="planned_on"):
            programmes.change_visit(c, None, instance.visits[0].id, {"planned_on": None})
