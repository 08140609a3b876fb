"""Outcome of feedback in a session's live trial: cues matched to the strides of the analysis."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sqlalchemy import Connection

from sagittal.core.change.limits import Limb
from sagittal.core.feedback import AnalysedStride, Cue, split
from sagittal.core.frames import Side
from sagittal.core.parameters import cycle_curves
from sagittal.core.parameters.rows import Column
from sagittal.core.subject.condition import is_alike
from sagittal.server.clinic.patients import Patient
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.view import feedback as report
from sagittal.server.report.view.feedback import FeedbackView
from sagittal.server.report.view.feedback_beside import PreviousTraining, side_effects
from sagittal.server.results import prescriptions
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.results.prescriptions import TrainedTake
from sagittal.server.results.reviewed import ReviewedAnalyses

REASONS: Final = {
    "no_feedback": "No live take of this session gave feedback.",
    "not_analysed": "The live take with feedback is not analysed yet.",
    "other_recording": "The analysis is of another recording than the live take with feedback.",
}
"""Why there is no result, in sentences."""


@dataclass(frozen=True, eq=False)
class TrainedSession:
    """A session with feedback: its analysis, training, and cues of the analysed trial."""

    at: AnalysedSession
    training: TrainedTake
    cues: tuple[Cue, ...]


@dataclass(frozen=True, eq=False)
class FeedbackRecords:
    """Database records of feedback in a session.

    Parameters
    ----------
    this : None with a `reason`. before : the previous visit with the same training and condition.
    """

    patient: Patient
    this: TrainedSession | None
    before: TrainedSession | None = None
    reason: str | None = None


def gather(
    c: Connection, patient: Patient, session_id: str, done: Sequence[AnalysedSession]
) -> FeedbackRecords:
    """Read everything `view` requires for a session of this patient.

    Parameters
    ----------
    done : the analysed sessions of the patient (histories.analysed).
    """
    by_session = {a.session.id: a for a in done}
    history = prescriptions.trainings(c, patient.id)
    of_this_session = [t for t in history if t.session_id == session_id]
    if not of_this_session:
        return FeedbackRecords(patient, None, reason="no_feedback")
    this = _analysed_take(by_session.get(session_id), of_this_session)
    if isinstance(this, str):
        return FeedbackRecords(patient, None, reason=this)
    earlier = (
        t
        for t in reversed(history[: history.index(of_this_session[0])])
        if prescriptions.same_training(t.content, this.content)
        and _analysed_take(by_session.get(t.session_id), [t]) is t
        and is_alike(by_session[t.session_id].condition, by_session[session_id].condition)
    )
    sessions_compared = [this, *itertools.islice(earlier, 1)]
    cues = prescriptions.cues(c, [t.take_id for t in sessions_compared])
    trained = [TrainedSession(by_session[t.session_id], t, tuple(cues[t.take_id])) for t in sessions_compared]
    return FeedbackRecords(patient, trained[0], trained[1] if len(trained) == 2 else None)


def view(reviewed: ReviewedAnalyses, gathered: FeedbackRecords) -> FeedbackView | None:
    """Combine cues and strides; None if there are none, with a `reason`; raises IntegrityError."""
    this, previous = gathered.this, gathered.before
    if this is None:
        return None
    content = this.training.content
    bundle, strides = _strides(reviewed, this)
    stood = bundle.angles is not None and bundle.angles.zero == "standing"
    curves = cycle_curves(bundle.angles, bundle.strides) if stood and bundle.angles else None
    earlier = None
    if previous is not None:
        previous_session = previous.at.session
        earlier = PreviousTraining(
            previous_session.id,
            previous_session.performed_on,
            split(_strides(reviewed, previous)[1], previous.cues),
        )
    return report.feedback_view(
        content,
        split(strides, this.cues),
        side_effects(content, this.training.baseline, strides, curves),
        earlier,
        _limb(gathered.patient, content.side),
    )


def _strides(
    reviewed: ReviewedAnalyses, trained: TrainedSession
) -> tuple[Bundle, tuple[AnalysedStride, ...]]:
    """Strides of an analysis with edits, each with its value of the trained parameter."""
    bundle = reviewed.read_bundle(trained.at.found, trained.at.edits)
    columns = reviewed.read_columns(trained.at.found, trained.at.edits)
    nothing: Column = (None,) * len(bundle.strides.strides)
    column = columns.get(trained.training.content.parameter, nothing)
    return bundle, report.list_analysed_strides(bundle.strides, column)


def _analysed_take(analysed: AnalysedSession | None, takes: Sequence[TrainedTake]) -> TrainedTake | str:
    """The live trial on which a session's analysis is based, or the reason why there is none."""
    if analysed is None:
        return "not_analysed"
    take = next((t for t in takes if t.recording_id == analysed.found.recording_id), None)
    if take is not None:
        return take
    return "not_analysed" if takes[-1].recording_id is None else "other_recording"


def _limb(patient: Patient, side: Side | None) -> Limb | None:
    if patient.affected_side is None or side is None:
        return None
    return "affected" if side == patient.affected_side else "unaffected"
