"""Biofeedback prescriptions: create, replace, end, and prepare for a live trial.

Records are immutable: a change ends one and creates another, so that every trial and its cues refer to the
prescription in force at the time. One prescription, for one parameter, is in force at a time
(docs/science/feedback.md).
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from sqlalchemy import Connection, Select, bindparam, insert, select, update

from sagittal.core.change import ChangeLimit, find_detectable_change
from sagittal.core.change.limits import Limb
from sagittal.core.feedback import Baseline, Cue, Prescription
from sagittal.core.frames import Side
from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server import audit
from sagittal.server.clinic import patients, sessions
from sagittal.server.clinic.patients import Patient
from sagittal.server.errors import Conflict, NotFound, ServiceError
from sagittal.server.results import targets
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.results.targets import AnalysedWalk
from sagittal.server.storage.schema.live_tables import live_event, live_take
from sagittal.server.storage.schema.tables import new_id, now, prescription, session, user


@dataclass(frozen=True)
class PatientPrescription:
    """A prescription of a patient.

    Parameters
    ----------
    content : trained parameter with its numeric target as of that day. by : author, None = the program.
    ended_at : None while in force.
    """

    id: str
    patient_id: str
    content: Prescription
    created_at: dt.datetime
    by: str | None
    ended_at: dt.datetime | None


def write(
    c: Connection,
    reviewed: ReviewedAnalyses,
    actor: audit.Actor | None,
    patient_id: str,
    content: Mapping[str, object],
) -> PatientPrescription:
    """Prescribe feedback and end the prescription in force.

    Raises
    ------
    NotFound: the patient. ParameterError, ServiceError bad_prescription: a field is invalid. ServiceError
    no_target: the source has no target for this patient; the message gives the reason. both_sides: a side is
    given for a bilateral parameter.
    """
    patient = patients.get(c, patient_id)
    draft = Prescription.from_json(content)
    entry = CATALOGUE[draft.parameter]
    if entry.shared and draft.side is not None:
        raise ServiceError(
            "both_sides",
            Message(
                "{label} is common to both sides of a walk, so the {side} side cannot be trained alone. "
                "Expected both sides, or another parameter.",
                label=entry.label,
                side=draft.side,
            ),
        )
    targeted = _with_target(c, reviewed, patient, draft)
    previous = in_force(c, patient_id)
    if previous is not None:
        _end(c, actor, previous)
    written_id = new_id()
    c.execute(
        insert(prescription).values(
            id=written_id,
            patient_id=patient_id,
            content=targeted.to_json(),
            created_at=now(),
            created_by=actor.user_id if actor else None,
        )
    )
    audit.record(c, actor, "prescription.written", "patient", patient_id, _said(written_id, targeted))
    return get(c, written_id)


def end(c: Connection, actor: audit.Actor | None, prescription_id: str) -> PatientPrescription:
    """End a prescription; raises NotFound, Conflict prescription_ended."""
    this = get(c, prescription_id)
    if this.ended_at is not None:
        raise Conflict("prescription_ended", "This prescription has ended already; write a new one instead.")
    _end(c, actor, this)
    return get(c, prescription_id)


def get(c: Connection, prescription_id: str) -> PatientPrescription:
    """One prescription; raises NotFound."""
    row = c.execute(_QUERY.where(prescription.c.id == prescription_id)).first()
    if row is None:
        raise NotFound("prescription", prescription_id)
    return _written(row)


def of_patient(c: Connection, patient_id: str) -> list[PatientPrescription]:
    """All prescriptions of a patient, newest first."""
    query = _QUERY.where(prescription.c.patient_id == patient_id)
    rows = c.execute(query.order_by(prescription.c.created_at.desc(), prescription.c.id))
    return [_written(row) for row in rows]


def in_force(c: Connection, patient_id: str) -> PatientPrescription | None:
    """The prescription in force, None without one."""
    return next((w for w in of_patient(c, patient_id) if w.ended_at is None), None)


def for_take(
    c: Connection, reviewed: ReviewedAnalyses, session_id: str
) -> tuple[Prescription, Baseline] | None:
    """Prescription for a live trial of this session, with its numeric target; None if there is none.

    Norms depend on gait speed: they are looked up for the last walk before this session. If that yields none,
    and for all other sources, the numbers from the time of prescription are used.
    """
    this = sessions.get(c, session_id)
    written = in_force(c, this.patient_id)
    if written is None:
        return None
    patient = patients.get(c, this.patient_id)
    content = written.content
    by_norm = content.target.source == "norm"
    walk = targets.last_walk(c, reviewed, patient, reference=this, with_controls=by_norm)
    if by_norm:
        fresh = targets.offer(walk, "norm", content.parameter, content.side).target
        content = content if fresh is None else replace(content, target=fresh)
    return content, _baseline(c, written, patient, walk, session_id)


def cues(c: Connection, take_ids: Sequence[str]) -> dict[str, list[Cue]]:
    """Cues of each of these trials in order of time."""
    query = (
        select(live_event.c.take_id, live_event.c.content)
        .where(live_event.c.kind == "cue", live_event.c.take_id.in_(take_ids))
        .order_by(live_event.c.seq)
    )
    by_take: dict[str, list[Cue]] = {take: [] for take in take_ids}
    for take, content in c.execute(query):
        by_take[take].append(Cue.from_json(content))
    return by_take


@dataclass(frozen=True)
class TrainedTake:
    """A live trial with feedback.

    Parameters
    ----------
    recording_id : the resulting recording, None while running. content, baseline : as at the start of the
        trial.
    """

    take_id: str
    session_id: str
    recording_id: str | None
    performed_on: dt.date
    prescription_id: str
    content: Prescription
    baseline: Baseline


def trainings(c: Connection, patient_id: str) -> list[TrainedTake]:
    """All live trials of a patient with cues, oldest first."""
    rows = c.execute(_trainings(), {"of_patient": patient_id})
    return [
        TrainedTake(
            take_id,
            session_id,
            recording_id,
            day,
            prescription_id,
            Prescription.from_json(begun["prescription"]),
            Baseline.from_json(begun["baseline"] or {}),
        )
        for take_id, session_id, recording_id, day, prescription_id, begun in rows
    ]


@cache
def _trainings() -> Select[Any]:
    gave = select(live_event.c.seq).where(live_event.c.take_id == live_take.c.id, live_event.c.kind == "cue")
    begun = (
        select(live_event.c.content)
        .where(live_event.c.take_id == live_take.c.id, live_event.c.kind == "prescription")
        .order_by(live_event.c.seq)
        .limit(1)
        .scalar_subquery()
    )
    return (
        select(
            live_take.c.id,
            live_take.c.session_id,
            live_take.c.recording_id,
            session.c.performed_on,
            live_take.c.prescription_id,
            begun,
        )
        .join(session, session.c.id == live_take.c.session_id)
        .where(
            session.c.patient_id == bindparam("of_patient"),
            live_take.c.prescription_id.is_not(None),
            gave.exists(),
        )
        .order_by(session.c.performed_on, live_take.c.created_at, live_take.c.id)
    )


def same_training(a: Prescription, b: Prescription) -> bool:
    """Whether the same parameter and side are trained; a change of schedule does not matter."""
    return (a.parameter, a.side) == (b.parameter, b.side)


def _with_target(
    c: Connection, reviewed: ReviewedAnalyses, patient: Patient, requested: Prescription
) -> Prescription:
    source = requested.target.source
    if source == "manual":
        _refuse_impossible(requested)
        return replace(requested, target=replace(requested.target, words="entered", session_id=None))
    chosen = None if source == "norm" else requested.target.session_id
    walk = targets.last_walk(c, reviewed, patient, session_id=chosen)
    target_offer = targets.offer(walk, source, requested.parameter, requested.side)
    if target_offer.target is None:
        raise ServiceError("no_target", target_offer.reason or "")
    return replace(requested, target=replace(target_offer.target, source=source))


def _refuse_impossible(requested: Prescription) -> None:
    """Raise ServiceError bad_prescription for an implausible target, such as 60 typed for 0.60."""
    entry, mean, sd = CATALOGUE[requested.parameter], requested.target.mean, requested.target.sd
    low, high = entry.target_range
    unit = f" {entry.printed_unit}" if entry.printed_unit else ""
    if mean is not None and not low <= mean <= high:
        raise ServiceError(
            "bad_prescription",
            Message(
                "target.mean is {mean:g}{unit}. Expected {low:g} to {high:g}{unit2} for {lower}.",
                mean=mean,
                unit=unit,
                low=low,
                high=high,
                unit2=unit,
                lower=entry.label.lower(),
            ),
        )
    if sd is not None and sd > high - low:
        raise ServiceError(
            "bad_prescription",
            Message(
                "target.sd is {sd:g}{unit}. Expected at most {low:g}{unit2}.",
                sd=sd,
                unit=unit,
                low=high - low,
                unit2=unit,
            ),
        )


def _baseline(
    c: Connection, written: PatientPrescription, patient: Patient, walk: AnalysedWalk | None, session_id: str
) -> Baseline:
    content = written.content
    trained = trainings(c, patient.id)
    alike = [t for t in trained if same_training(t.content, content)]
    today = any(t.session_id == session_id for t in alike)
    baseline = Baseline(
        last_level=_last_level(c, [t for t in trained if t.prescription_id == written.id]),
        # the block opens the visit, not its later trials
        after_training=bool(alike) and not today,
    )
    usual = None if walk is None else targets.find_usual_value(walk, content.parameter, content.side)
    if walk is not None and usual is not None:
        baseline = replace(baseline, mean=usual.mean, sd=usual.sd, n=usual.n, session_id=walk.session.id)
    mdc = None if content.side is None else _mdc(patient, content, walk, targets.opposite_side(content.side))
    if mdc is None:
        return baseline
    return replace(baseline, other_mdc=mdc.value, other_mdc_source=f"MDC, {mdc.source}")


def _mdc(
    patient: Patient, content: Prescription, walk: AnalysedWalk | None, side: Side
) -> ChangeLimit | None:
    """MDC of the untrained side, at its usual value or otherwise at the target."""
    usual = None if walk is None else targets.find_usual_value(walk, content.parameter, side)
    value = content.target.mean if usual is None else usual.mean
    limb: Limb | None = None
    if patient.affected_side is not None:
        limb = "affected" if side == patient.affected_side else "unaffected"
    return None if value is None else find_detectable_change(content.parameter, value, limb)


def _last_level(c: Connection, own: Sequence[TrainedTake]) -> int | None:
    """Level of the last cue of the training itself; probe blocks at the start may have none yet."""
    for training in reversed(own):
        trial_cues = cues(c, [training.take_id])[training.take_id]
        levels = [q.level for q in trial_cues if q.why_not not in {"baseline", "retention"}]
        if levels:
            return levels[-1]
    return None


def _end(c: Connection, actor: audit.Actor | None, this: PatientPrescription) -> None:
    c.execute(update(prescription).where(prescription.c.id == this.id).values(ended_at=now()))
    audit.record(c, actor, "prescription.ended", "patient", this.patient_id, _said(this.id, this.content))


def _said(written_id: str, content: Prescription) -> dict[str, object]:
    return {"prescription_id": written_id, "parameter": content.parameter, "side": content.side}


_QUERY = select(prescription, user.c.display_name.label("by")).join(
    user, user.c.id == prescription.c.created_by, isouter=True
)


def _written(row: Any) -> PatientPrescription:
    return PatientPrescription(
        row.id, row.patient_id, Prescription.from_json(row.content), row.created_at, row.by, row.ended_at
    )
