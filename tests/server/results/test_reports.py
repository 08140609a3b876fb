"""The report of an analysis for this person on that day."""

from __future__ import annotations

import pytest

from sagittal.core.events.edits import Edit
from sagittal.server.clinic import patients
from sagittal.server.clinic.patients import Patient
from sagittal.server.errors import NotFound
from sagittal.server.results import histories, reports, reviews
from sagittal.server.results.histories import AnalysedSession
from tests.helpers.clinic import Clinic
from tests.server import feedback


@pytest.fixture(scope="module")
def course(stored: Clinic) -> tuple[Patient, list[AnalysedSession]]:
    """Two visits of a person, a week apart."""
    patient = feedback.person(stored)
    for days in (0, 7):
        feedback.walked(stored, patient, days, 12.0)
    with stored.db.read() as c:
        return patients.get(c, patient), histories.list_analysed(c, patient)


def test_a_report_says_how_it_was_walked_and_compares_with_no_visit_by_itself(
    stored: Clinic, course: tuple[Patient, list[AnalysedSession]]
) -> None:
    patient, (first, _) = course
    bundle, model = reports.read(stored.app.state.reviewed, first.found, first.edits, patient, first.session)
    assert len(bundle.strides.strides) > 0
    assert model.condition == first.condition.words
    assert model.since is None
    assert all(row.change == () for _, rows in model.groups for row in rows)


def test_a_report_beside_an_earlier_visit_tells_changes(
    stored: Clinic, course: tuple[Patient, list[AnalysedSession]]
) -> None:
    patient, (first, second) = course
    state = (stored.app.state.reviewed, second.found, second.edits, patient, second.session)
    _, model = reports.read(*state, previous=first)
    assert model.since is not None
    assert (model.since.session_id, model.since.performed_on) == (
        first.session.id,
        first.session.performed_on,
    )
    assert any(row.change for _, rows in model.groups for row in rows)
    assert model.headline is not None
    assert model.headline.changes is not None


def test_a_number_is_opened_with_its_strides_and_an_edit_counts(
    stored: Clinic, course: tuple[Patient, list[AnalysedSession]]
) -> None:
    patient, (first, _) = course
    reviewed = stored.app.state.reviewed
    initial = reports.behind_number(
        reviewed, first.found, first.edits, patient, first.session, "stride_time_s"
    )
    item = next(s for s in reviewed.open(first.found).bundle.strides.strides if s.excluded_reason is None)
    edit = Edit("exclude_stride", item.side, (item.start_s + item.end_s) / 2, reason="stumbled")
    _, edits = reviews.make(stored.db, reviewed, None, first.session.id, edit)
    final = reports.behind_number(reviewed, first.found, edits, patient, first.session, "stride_time_s")
    assert initial.row.name == "stride_time_s"
    assert len(initial.strides) == len(final.strides) > 0

    def n(one: object) -> int:
        row = one.row  # type: ignore[attr-defined]
        return sum(cell.n for cell in (row.left, row.right) if cell is not None)

    assert n(final) == n(initial) - 1


def test_a_parameter_that_no_row_has_is_not_found(
    stored: Clinic, course: tuple[Patient, list[AnalysedSession]]
) -> None:
    patient, (first, _) = course
    with pytest.raises(NotFound, match="moonwalk"):
        reports.behind_number(
            stored.app.state.reviewed, first.found, first.edits, patient, first.session, "moonwalk"
        )
