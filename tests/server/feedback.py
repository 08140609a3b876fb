"""Prescriptions and live takes with cues in a test's clinic, without a tablet."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from typing import Any

from sagittal.core.feedback import Cue
from sagittal.server.clinic import patients, sessions
from sagittal.server.live_takes import live, live_events, live_training
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.storage.schema.live_tables import live_take
from sagittal.server.storage.schema.tables import new_id
from tests.helpers.clinic import Clinic
from tests.server import analysed

DAY = dt.date(2026, 3, 2)


def person(clinic: Clinic, **changes: Any) -> str:
    """A patient whose left side is affected."""
    known_fields: dict[str, Any] = {
        "height_m": 1.75,
        "birth_year": 1960,
        "sex": "male",
        "affected_side": "left",
    } | changes
    with clinic.db.write() as c:
        return patients.create(c, None, code=f"P-{new_id()[:8]}", **known_fields).id


def visit(clinic: Clinic, patient: str, days: int, **values: Any) -> str:
    """A session without anything in it."""
    with clinic.db.write() as c:
        return sessions.create(c, None, patient, performed_on=DAY + dt.timedelta(days=days), **values).id


def walked(clinic: Clinic, patient: str, days: int, duration_s: float = 24.0, **values: Any) -> str:
    """A session with a finished analysis of the kinematic walk."""
    session = visit(clinic, patient, days, **values)
    analysed.finish(clinic, patient, session, analysed.files(duration_s))
    return session


def take(
    clinic: Clinic, session: str, prescription: str, cues: Sequence[Cue], recording: str | None = None
) -> str:
    """A live take of a session with this prescription in force, as `ended_take`."""
    begun, result = ended_take(clinic.db, clinic.app.state.blobs, session, cues, recording)
    assert begun.prescription_id == prescription
    return result


def ended_take(
    db: Database, blobs: BlobStore, session: str, cues: Sequence[Cue], recording: str | None
) -> tuple[live_training.LiveTraining, str]:
    """A take that gave these cues and has ended as this recording: how it began, and its id."""
    with db.write() as c:
        result, code = live.open_take(c, None, session)
        live.pair(c, code)
    begun = live_training.training_of(db, ReviewedAnalyses(blobs), result)
    with db.write() as c:
        live.note_start(c, result.id, "replay")
        for cue in cues:
            live_events.add_event(c, None, result.id, "cue", cue.t_s, {"type": "cue", **cue.to_json()})
        live.end(c, None, result.id, "finished", count=1)
        c.execute(live_take.update().where(live_take.c.id == result.id).values(recording_id=recording))
    return begun, result.id
