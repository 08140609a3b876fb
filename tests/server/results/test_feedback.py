"""Feedback results of a session: related visits, or the reason for none."""

from __future__ import annotations

import pytest

from sagittal.core.feedback import Cue
from sagittal.server.clinic import patients
from sagittal.server.results import histories, prescriptions
from sagittal.server.results.feedback import REASONS, FeedbackRecords, _limb, gather, view
from tests.helpers.clinic import Clinic
from tests.server import feedback

GIVEN = {"parameter": "stance_pct", "side": "left", "target": {"source": "manual", "mean": 64.0, "sd": 1.0}}


def cue(n: int, start_s: float) -> Cue:
    return Cue(n, "left", start_s, start_s + 1.1, 62.0, 0.0, "in", True, None, 1, 60.0, 68.0)


def recording_of(stored: Clinic, patient: str, session: str) -> str:
    with stored.db.read() as c:
        return next(
            a.found.recording_id for a in histories.list_analysed(c, patient) if a.session.id == session
        )


def cues_of(stored: Clinic, patient: str, session: str) -> list[Cue]:
    """One for every left stride of the analysis."""
    with stored.db.read() as c:
        done = next(a for a in histories.list_analysed(c, patient) if a.session.id == session)
    strides = stored.app.state.reviewed.read_bundle(done.found, done.edits).strides.strides
    return [cue(i, s.start_s) for i, s in enumerate(strides) if s.side == "left"]


class Training:
    """A person with a prescription."""

    def __init__(self, stored: Clinic) -> None:
        self.stored = stored
        self.patient = feedback.person(stored)
        with stored.db.write() as c:
            reviewed = stored.app.state.reviewed
            self.prescription = prescriptions.write(c, reviewed, None, self.patient, GIVEN).id

    def walk(self, days: int, *, told: bool = True, recording: bool = True, **condition: object) -> str:
        """An analysed session, with a live take that gave cues on every left stride."""
        session = feedback.walked(self.stored, self.patient, days, 12.0, **condition)
        if told:
            mine = recording_of(self.stored, self.patient, session) if recording else None
            cues = cues_of(self.stored, self.patient, session)
            feedback.take(self.stored, session, self.prescription, cues, mine)
        return session

    def gather(self, session: str) -> FeedbackRecords:
        with self.stored.db.read() as c:
            response = patients.get(c, self.patient)
            return gather(c, response, session, histories.list_analysed(c, self.patient))


@pytest.fixture
def training(stored: Clinic) -> Training:
    return Training(stored)


def test_a_session_without_feedback_says_so(training: Training) -> None:
    results = training.gather(training.walk(0, told=False))
    assert (results.this, results.before, results.reason) == (None, None, "no_feedback")
    assert results.reason in REASONS
    assert view(training.stored.app.state.reviewed, results) is None


def test_a_take_that_is_not_analysed_yet_and_an_analysis_of_another_recording(training: Training) -> None:
    assert training.gather(training.walk(0, recording=False)).reason == "not_analysed"
    session = training.walk(3, told=False)
    elsewhere = recording_of(training.stored, training.patient, training.walk(5, told=False))
    feedback.take(training.stored, session, training.prescription, [cue(0, 1.0)], elsewhere)
    assert training.gather(session).reason == "other_recording"
    empty = feedback.visit(training.stored, training.patient, 7)
    feedback.take(training.stored, empty, training.prescription, [cue(0, 1.0)], None)
    assert training.gather(empty).reason == "not_analysed"


def test_a_training_is_held_against_the_last_one_before_it_that_was_walked_alike(training: Training) -> None:
    oldest, first = training.walk(0), training.walk(1)
    training.walk(2, pace="fast")
    second = training.walk(4)
    assert training.gather(oldest).before is None
    results = training.gather(second)
    assert results.this is not None
    assert results.before is not None
    assert (results.this.at.session.id, results.before.at.session.id) == (second, first)
    visible_view = view(training.stored.app.state.reviewed, results)
    assert visible_view is not None
    assert (
        {row.kind: row.n for row in visible_view.rows}["with"]
        == len(results.this.cues) - visible_view.split.left_out
        > 0
    )
    assert visible_view.split.unmatched == 0
    assert visible_view.content.parameter == "stance_pct"


def test_the_limb_is_affected_or_not_where_both_are_known(stored: Clinic) -> None:
    one, other_patient = feedback.person(stored), feedback.person(stored, affected_side=None)
    with stored.db.read() as c:
        known_response, unknown = patients.get(c, one), patients.get(c, other_patient)
    assert _limb(known_response, "left") == "affected"
    assert _limb(known_response, "right") == "unaffected"
    assert _limb(known_response, None) is None
    assert _limb(unknown, "left") is None
