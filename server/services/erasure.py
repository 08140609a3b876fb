"""Removing a session or a patient for good: rows in one transaction, then the bytes; the audit remembers.

`logs` is the folder of the live takes' logs (Settings.live). A running job of theirs loses its row, so its
worker meets a closed fence and publishes nothing; what it may have written goes with the sweep.
"""

from __future__ import annotations

from pathlib import Path

from sqlalchemy import Connection, delete, select, update

from server import audit
from server.services import patients, reviews, sessions
from server.services.errors import Conflict
from server.services.sweep import referenced, sweep
from server.storage import fs
from server.storage.blobs import BlobStore
from server.storage.db import Database
from server.storage.tables import (
    analysis,
    analysis_file,
    edit,
    job,
    live_event,
    live_take,
    patient,
    planned_visit,
    prescription,
    programme,
    recording,
    recording_file,
    session,
)


def erase_patient(
    db: Database,
    blobs: BlobStore,
    logs: Path,
    actor: audit.Actor | None,
    patient_id: str,
    *,
    confirm: str,
) -> None:
    """Erase a patient with everything; `confirm` repeats the code, else Conflict not_confirmed."""
    with db.write() as c:
        found = patients.get(c, patient_id)
        if confirm.strip() != found.code:
            raise Conflict(
                "not_confirmed", f"To delete this patient for good, repeat the code '{found.code}'."
            )
        mine = select(session.c.id).where(session.c.patient_id == patient_id)
        takes = [
            take
            for session_id in c.execute(mine).scalars().all()
            for take in _erase_session_rows(c, session_id)
        ]
        plans = select(programme.c.id).where(programme.c.patient_id == patient_id).scalar_subquery()
        c.execute(delete(planned_visit).where(planned_visit.c.programme_id.in_(plans)))
        c.execute(delete(programme).where(programme.c.patient_id == patient_id))
        c.execute(delete(prescription).where(prescription.c.patient_id == patient_id))
        c.execute(delete(patient).where(patient.c.id == patient_id))
        audit.record(c, actor, "patient.erased", "patient", patient_id, {"sessions": found.sessions})
    blobs.erase(patient_id)
    _erase_logs(logs, takes)
    reviews.forget()
    db.fold()


def erase_session(
    db: Database, blobs: BlobStore, logs: Path, actor: audit.Actor | None, session_id: str
) -> None:
    """Erase one session with its recordings and results; raises NotFound."""
    with db.write() as c:
        found = sessions.get(c, session_id)
        own = {sha256 for space, sha256 in referenced(c, session_id) if space == found.patient_id}
        takes = _erase_session_rows(c, session_id)
        audit.record(c, actor, "session.erased", "session", session_id, {"patient_id": found.patient_id})
    _erase_logs(logs, takes)
    reviews.forget()
    sweep(db, blobs, grace_s=0.0, only={(found.patient_id, sha256) for sha256 in own})


def _erase_session_rows(c: Connection, session_id: str) -> list[str]:
    """Remove the rows and return the ids of the live takes that were among them."""
    takes = list(c.execute(select(live_take.c.id).where(live_take.c.session_id == session_id)).scalars())
    c.execute(delete(live_event).where(live_event.c.take_id.in_(takes)))
    c.execute(delete(live_take).where(live_take.c.id.in_(takes)))
    recordings = select(recording.c.id).where(recording.c.session_id == session_id).scalar_subquery()
    analyses = select(analysis.c.id).where(analysis.c.recording_id.in_(recordings)).scalar_subquery()
    c.execute(delete(edit).where(edit.c.analysis_id.in_(analyses)))
    c.execute(delete(analysis_file).where(analysis_file.c.analysis_id.in_(analyses)))
    c.execute(delete(analysis).where(analysis.c.recording_id.in_(recordings)))
    c.execute(delete(job).where(job.c.recording_id.in_(recordings)))
    c.execute(delete(recording_file).where(recording_file.c.recording_id.in_(recordings)))
    c.execute(delete(recording).where(recording.c.session_id == session_id))
    # the plan outlives the session: its visit is open again
    c.execute(update(planned_visit).where(planned_visit.c.session_id == session_id).values(session_id=None))
    c.execute(delete(session).where(session.c.id == session_id))
    return takes


def _erase_logs(folder: Path, takes: list[str]) -> None:
    for take in takes:
        fs.remove_file(folder / f"{take}.log")
