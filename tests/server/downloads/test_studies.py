"""The tables of a study: which visits are in them, by which names, and what stays in the clinic."""

from __future__ import annotations

import csv
import datetime as dt
import io
import json
from typing import Any

import pytest

from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.downloads.exports import make_pseudonym
from sagittal.server.downloads.studies import MOST_VISITS, StudyChoice, check_size, list_visits, make_study
from sagittal.server.errors import Conflict
from sagittal.server.report.study_tables import FAILURES, PROVENANCE
from sagittal.server.results import analyses
from sagittal.server.safekeeping.erasure import erase_session
from sagittal.server.uploads import recordings
from tests.helpers.clinic import Clinic
from tests.server import feedback
from tests.server.results.test_visits import take

ADMIN = Identity("u", "ada", "Ada", Role.ADMIN, "l")


@pytest.mark.parametrize(("visits", "code"), [(0, "no_visits"), (MOST_VISITS + 1, "too_many_visits")])
def test_a_study_of_no_visit_or_of_too_many_is_refused(visits: int, code: str) -> None:
    with pytest.raises(Conflict) as refused:
        check_size([take("a").session] * visits)
    assert refused.value.code == code


@pytest.mark.parametrize("visits", [1, MOST_VISITS])
def test_as_many_visits_as_are_allowed_are_one_study(visits: int) -> None:
    assert check_size([take("a").session] * visits) is None  # type: ignore[func-returns-value]


class Course:
    """Jane walked on the second of March and a week later; a third visit has no analysis."""

    def __init__(self, stored: Clinic) -> None:
        self.stored = stored
        self.jane = feedback.person(stored, note="Jane Doe", birth_year=1930)
        self.walked = [feedback.walked(stored, self.jane, days, 12.0) for days in (0, 7)]
        self.empty = feedback.visit(stored, self.jane, 9, title="Jane")
        other_patient = feedback.person(stored)
        self.other = feedback.walked(stored, other_patient, 1, 12.0, protocol="treadmill")

    def chosen(self, **choice: Any) -> list[str]:
        with self.stored.db.read() as c:
            return [s.id for s in list_visits(c, ADMIN, StudyChoice(**choice))]


@pytest.fixture(scope="module")
def course(stored: Clinic) -> Course:
    return Course(stored)


def test_a_choice_is_by_words_protocol_days_and_ticks(course: Course) -> None:
    day = feedback.DAY
    everything = course.chosen()
    assert set(everything) == {*course.walked, course.empty, course.other}
    assert course.chosen(search="Jane Doe") == [*course.walked, course.empty]
    assert course.chosen(protocol="treadmill") == [course.other]
    assert set(course.chosen(since=day + dt.timedelta(days=7))) == {course.walked[1], course.empty}
    assert set(course.chosen(until=day + dt.timedelta(days=1))) == {course.walked[0], course.other}
    assert course.chosen(visits=frozenset({course.other})) == [course.other]
    # each tick was taken away: nothing, not everything
    assert course.chosen(visits=frozenset()) == []


def test_persons_and_visits_stand_in_the_tables_by_pseudonyms_and_days_from_the_first(course: Course) -> None:
    stored = course.stored
    study, visits = make_study(stored.db, stored.app.state.reviewed, ADMIN, StudyChoice(search="Jane Doe"))
    assert visits == [*course.walked, course.empty]
    rows = list(csv.DictReader(io.StringIO(study.files["takes.csv"].decode())))
    sub = make_pseudonym(course.jane)
    assert [r["take"] for r in rows] == [f"sub-{sub}/ses-{make_pseudonym(v)}" for v in visits]
    assert [r["days_since_first"] for r in rows] == ["0", "7", "9"]
    assert {r["age_years"] for r in rows} == {"89"}
    assert [r["error"] for r in rows] == ["", "", "no_analysis"]
    assert rows[0]["sex"] == "male"
    assert rows[0]["height_m"] == "1.75"
    assert rows[0]["edits"] == "0"
    assert study.failed == 1
    assert b"Analyse or exclude it." in study.files[FAILURES]
    text = b"".join(study.files.values())
    for secret in (b"Jane", course.jane.encode(), course.walked[0].encode(), b"walk.txt", b"2026-03"):
        assert secret not in text, secret


def test_provenance_has_the_hash_of_each_file_by_a_number(course: Course) -> None:
    stored = course.stored
    choice = StudyChoice(visits=frozenset(course.walked[:1]))
    study, _ = make_study(stored.db, stored.app.state.reviewed, ADMIN, choice)
    with stored.db.read() as c:
        (file,) = recordings.require_current(c, course.walked[0]).files
    document = json.loads(study.files[PROVENANCE])
    (result,) = document["takes"].values()
    assert result == {"sha256": {"file-1": file.sha256}, "error": None}
    assert list(document["analyses"]) == list(document["takes"])


def test_a_visit_that_cannot_be_read_is_told_and_the_others_go_on(course: Course) -> None:
    stored = course.stored
    lost = feedback.walked(stored, course.jane, 20, 12.0)
    with stored.db.read() as c:
        blob = analyses.get_shown(c, lost).files["analysis.json"]
    choice = StudyChoice(visits=frozenset({lost, course.other}))
    path = stored.app.state.blobs.path(course.jane, blob.sha256)
    content = path.read_bytes()
    path.write_bytes(b"{}")
    try:
        stored.app.state.reviewed.forget()
        study, visits = make_study(stored.db, stored.app.state.reviewed, ADMIN, choice)
    finally:
        path.write_bytes(content)
        # the visits of the course are those of the other tests
        erase_session(stored.db, stored.app.state.reviewed, stored.settings, None, lost)
    assert len(visits) == 2
    assert study.failed == 1
    assert study.strides > 0
