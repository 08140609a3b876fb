"""Biofeedback prescriptions, available targets, and outcomes of a session."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from starlette.responses import Response

from sagittal.core.feedback.prescription import SOURCES
from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import list_trainable
from sagittal.server.api.documents import refusals
from sagittal.server.api.downloads.downloads import BINARY, attachment
from sagittal.server.api.results import feedback_schemas as schemas
from sagittal.server.api.schemas import Side
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, sessions
from sagittal.server.context import Db, Id, OpenTrail, Reviewed
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.http.problems import Problem
from sagittal.server.report.tables import feedback_csv
from sagittal.server.report.words.feedback_words import prescription_words
from sagittal.server.results import feedback, histories, prescriptions, targets
from sagittal.server.results.prescriptions import PatientPrescription
from sagittal.server.storage.db import Database
from sagittal.server.trail import AuditTrail

router = APIRouter(route_class=StrictJsonRoute, tags=["feedback"])
Reader = Annotated[Identity, require(Action.READ_RESULT)]
Therapist = Annotated[Identity, require(Action.RUN_LIVE)]
_CSV: dict[int | str, dict[str, Any]] = {
    200: {"description": "The table", "content": {"text/csv": {"schema": BINARY}}}
}


@router.get("/patients/{patient_id}/prescriptions", response_model=list[schemas.PrescriptionAnswer])
def list_prescriptions(patient_id: Id, db: Db, trail: OpenTrail, user: Reader) -> list[dict[str, Any]]:
    """List the patient's prescriptions, newest first; at most one is in force."""
    with db.read() as c:
        patients.get(c, patient_id)
        written = prescriptions.of_patient(c, patient_id)
    trail.record_opened(user, "prescriptions.opened", "patient", patient_id)
    return [_shown(w) for w in written]


@router.post(
    "/patients/{patient_id}/prescriptions", status_code=201, response_model=schemas.PrescriptionAnswer
)
def write_prescription(
    patient_id: Id, body: schemas.PrescriptionNew, db: Db, reviewed: Reviewed, user: Therapist
) -> dict[str, Any]:
    """Prescribe feedback; the prescription in force ends."""
    with db.write() as c:
        return _shown(prescriptions.write(c, reviewed, user, patient_id, body.model_dump(exclude_unset=True)))


@router.post(
    "/prescriptions/{prescription_id}/end", response_model=schemas.PrescriptionAnswer, responses=refusals(409)
)
def end_prescription(prescription_id: Id, db: Db, user: Therapist) -> dict[str, Any]:
    """End a prescription; it remains on record."""
    with db.write() as c:
        return _shown(prescriptions.end(c, user, prescription_id))


@router.get("/patients/{patient_id}/targets", response_model=list[schemas.TargetOffer])
def read_targets(
    patient_id: Id,
    db: Db,
    reviewed: Reviewed,
    trail: OpenTrail,
    user: Reader,
    parameter: Annotated[str, Query(max_length=64, description="one that a prescription can train")],
    side: Annotated[Side | None, Query(description="that is trained; none = both")] = None,
) -> list[dict[str, Any]]:
    """Targets of a parameter for this patient by source, or reasons why unavailable."""
    trainable = list_trainable()
    if parameter not in trainable:
        raise Problem(
            422,
            "bad_value",
            Message(
                "'{parameter}' cannot be trained; expected one of {trainable}.",
                parameter=parameter,
                trainable=", ".join(trainable),
            ),
        )
    with db.read() as c:
        walk = targets.last_walk(c, reviewed, patients.get(c, patient_id))
    trail.record_watched(user, "targets.opened", "patient", patient_id)
    offers = [(source, targets.offer(walk, source, parameter, side)) for source in SOURCES]
    return [
        {
            "source": source,
            "mean": None if o.target is None else o.target.mean,
            "sd": None if o.target is None else o.target.sd,
            "words": None if o.target is None else o.target.words,
            "reason": o.reason,
        }
        for source, o in offers
    ]


@router.get("/sessions/{session_id}/feedback", response_model=schemas.Feedback)
def read_feedback(
    session_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader
) -> dict[str, object]:
    """Strides with and without feedback, probe blocks, level, side effects and retention test."""
    gathered = _opened(db, trail, user, session_id)
    view = feedback.view(reviewed, gathered)
    if view is not None:
        return view.to_json()
    return {"reason": feedback.REASONS[gathered.reason or ""]}


@router.get("/sessions/{session_id}/feedback.csv", response_class=Response, responses=_CSV)
def read_feedback_table(
    session_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader
) -> Response:
    """All strides of the live trial with their cues; without feedback only the header."""
    view = feedback.view(reviewed, _opened(db, trail, user, session_id))
    return attachment(feedback_csv(view), f"feedback-{session_id[:8]}.csv")


def _opened(db: Database, trail: AuditTrail, user: Identity, session_id: str) -> feedback.FeedbackRecords:
    with db.read() as c:
        patient = patients.get(c, sessions.get(c, session_id).patient_id)
        records = feedback.gather(c, patient, session_id, histories.list_analysed(c, patient.id))
    trail.record_opened(user, "feedback.opened", "session", session_id)
    return records


def _shown(written: PatientPrescription) -> dict[str, Any]:
    lines = [f"{label}: {text}" for label, text in prescription_words(written.content)]
    return {**vars(written), "content": written.content.to_json(), "words": lines}
