"""Parameters of estimation and feedback of a live trial, fixed at its first sample and stored as an event.

A replay after a crash requires the same target and baseline, even if the prescription has changed.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, select, update

from sagittal.core.errors import SagittalError
from sagittal.server import audit
from sagittal.server.clinic import sessions
from sagittal.server.live_takes import live, live_events
from sagittal.server.results import analyses, prescriptions
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.live_tables import live_event, live_take
from sagittal.server.storage.schema.tables import session

log = logging.getLogger(__name__)

KIND = "prescription"


@dataclass(frozen=True)
class LiveTraining:
    """Parameters of the estimator in addition to the samples.

    Parameters
    ----------
    height_m, protocol : of the session or the patient.
    prescription_id, prescription, baseline : JSON of sagittal.core.feedback, None = no feedback.
    """

    height_m: float | None
    protocol: str
    prescription_id: str | None = None
    prescription: Mapping[str, Any] | None = None
    baseline: Mapping[str, Any] | None = None


def training_of(db: Database, reviewed: ReviewedAnalyses, take: live.LiveTakeRecord) -> LiveTraining:
    """Stored parameters of a trial, or those for starting it now."""
    query = select(live_event.c.content).where(live_event.c.take_id == take.id, live_event.c.kind == KIND)
    with db.read() as c:
        manifest = analyses.complete_manifest(c, take.session_id, None)
        content = c.execute(query.order_by(live_event.c.seq).limit(1)).scalar()
        begins = content is None
        if content is None:
            content = _prescribed(c, reviewed, take)
    if begins:
        with db.write() as c:
            live_events.add_event(c, None, take.id, KIND, None, content)
            row = update(live_take).where(live_take.c.id == take.id)
            c.execute(row.values(prescription_id=content["id"]))
    height, protocol = manifest.get("subject", {}).get("height_m"), manifest["protocol"]
    return LiveTraining(height, protocol, content["id"], content["prescription"], content["baseline"])


def note_feedback(c: Connection, take_ids: Collection[str]) -> None:
    """Mark the sessions of these trials as walked with feedback."""
    query = (
        select(session.c.id)
        .join(live_take, live_take.c.session_id == session.c.id)
        .where(live_take.c.id.in_(take_ids), ~session.c.feedback)
    )
    for session_id in c.execute(query.distinct()).scalars().all():
        sessions.change(c, None, session_id, {"feedback": True})


def settle_feedback(c: Connection, actor: audit.Actor | None, take: live.LiveTakeRecord) -> None:
    """Update the feedback mark if an earlier trial of the session had feedback, from the current trial.

    Otherwise the value set by a user remains; later cues set the mark themselves.
    """
    cues_by_take = prescriptions.cues(c, [t.id for t in live.takes_of(c, take.session_id)])
    has_feedback = {take_id: any(cue.with_feedback for cue in cues) for take_id, cues in cues_by_take.items()}
    if any(has_feedback.values()):
        sessions.change(c, actor, take.session_id, {"feedback": has_feedback[take.id]})


def _prescribed(c: Connection, reviewed: ReviewedAnalyses, take: live.LiveTakeRecord) -> dict[str, Any]:
    nothing = {"id": None, "prescription": None, "baseline": None}
    try:
        written = prescriptions.in_force(c, take.patient_id)
        prescribed = prescriptions.for_take(c, reviewed, take.session_id)
    except SagittalError:
        # an unreadable earlier visit must not prevent this recording
        log.exception("live take %s begins without feedback", take.id)
        return nothing
    if written is None or prescribed is None or not prescribed[0].target.resolved:
        return nothing
    return {"id": written.id, "prescription": prescribed[0].to_json(), "baseline": prescribed[1].to_json()}
