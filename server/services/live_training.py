"""What a live take is estimated and coached with: fixed at its first sample and kept as an event.

A replay after a crash needs the same target and the same baseline, whatever is prescribed meanwhile.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, select, update

from core.errors import SagittalError
from server.services import analyses, live, prescriptions
from server.storage.blobs import BlobStore
from server.storage.db import Database
from server.storage.tables import live_event, live_take

log = logging.getLogger(__name__)

KIND = "prescription"


@dataclass(frozen=True)
class Training:
    """What the estimator needs to know beside the samples.

    Parameters
    ----------
    height_m, protocol : of the session or the patient.
    prescription_id, prescription, baseline : JSON of core.feedback, None = no feedback.
    """

    height_m: float | None
    protocol: str
    prescription_id: str | None = None
    prescription: Mapping[str, Any] | None = None
    baseline: Mapping[str, Any] | None = None


def training_of(db: Database, blobs: BlobStore, take: live.Take) -> Training:
    """What this take began with, or begins with now."""
    query = select(live_event.c.content).where(live_event.c.take_id == take.id, live_event.c.kind == KIND)
    with db.read() as c:
        said = analyses.completed(c, take.session_id, None)
        content = c.execute(query.order_by(live_event.c.seq).limit(1)).scalar()
        begins = content is None
        if content is None:
            content = _prescribed(c, blobs, take)
    if begins:
        with db.write() as c:
            live.add_event(c, None, take.id, KIND, None, content)
            row = update(live_take).where(live_take.c.id == take.id)
            c.execute(row.values(prescription_id=content["id"]))
    height, protocol = said.get("subject", {}).get("height_m"), said["protocol"]
    return Training(height, protocol, content["id"], content["prescription"], content["baseline"])


def _prescribed(c: Connection, blobs: BlobStore, take: live.Take) -> dict[str, Any]:
    nothing = {"id": None, "prescription": None, "baseline": None}
    try:
        written = prescriptions.in_force(c, take.patient_id)
        found = prescriptions.for_take(c, blobs, take.session_id)
    except SagittalError:
        # an earlier visit that cannot be read must not keep this one from being recorded
        log.exception("live take %s begins without feedback", take.id)
        return nothing
    if written is None or found is None or not found[0].target.resolved:
        return nothing
    return {"id": written.id, "prescription": found[0].to_json(), "baseline": found[1].to_json()}
