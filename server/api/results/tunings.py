"""Tuning of filters on trials with a reference: request, list, download."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db, Id, OpenTrail, Queue
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.jobs.queue import JobView
from sagittal.server.results import tunings

router = APIRouter(route_class=StrictJsonRoute, tags=["tunings"])
Reader = Annotated[Identity, require(Action.READ_RESULT)]


@router.post(
    "/sessions/{session_id}/tunings", status_code=202, response_model=JobView, responses=refusals(409)
)
def tune(
    session_id: Id,
    body: schemas.TuningNew,
    db: Db,
    queue: Queue,
    user: Annotated[Identity, require(Action.ANALYSE)],
) -> JobView:
    """Fit the gains of a filter to the trials (.npz) among the session's files; analyses have priority."""
    order = tunings.TuningOrder(**body.model_dump())
    with db.write() as c:
        return tunings.submit(c, queue, user, session_id, order)


@router.get("/sessions/{session_id}/tunings", response_model=list[tunings.StoredTuning])
def list_tunings(session_id: Id, db: Db, trail: OpenTrail, user: Reader) -> list[tunings.StoredTuning]:
    """List finished tunings of a session, newest first."""
    with db.read() as c:
        rows = tunings.of_session(c, session_id)
    trail.record_watched(user, "tunings.opened", "session", session_id)
    return rows


@router.get("/tunings/{tuning_id}", response_model=tunings.StoredTuning)
def read_tuning(tuning_id: Id, db: Db, trail: OpenTrail, user: Reader) -> tunings.StoredTuning:
    """One tuning: gains, errors before and after on both halves, the sha256 of the data, and the verdict."""
    with db.read() as c:
        row = tunings.get(c, tuning_id)
    trail.record_opened(user, "tuning.opened", "tuning", tuning_id)
    return row
