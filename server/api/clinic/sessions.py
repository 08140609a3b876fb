"""Sessions: the recording of one visit, its inspection and its mapping."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.api.schemas import make_answer
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import sessions
from sagittal.server.context import Blobs, Config, Db, Id, LiveHub, OpenTrail, Queue, Reviewed
from sagittal.server.errors import NotFound
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.jobs.queue import JobView
from sagittal.server.safekeeping import erasure
from sagittal.server.uploads import recordings, tables

router = APIRouter(route_class=StrictJsonRoute, prefix="/sessions/{session_id}", tags=["sessions"])


@router.get("", response_model=sessions.Session)
def read_session(
    session_id: Id, db: Db, trail: OpenTrail, user: Annotated[Identity, require(Action.READ_SESSION)]
) -> sessions.Session:
    """Open a session."""
    with db.read() as c:
        session = sessions.get(c, session_id)
    trail.record_opened(user, "session.opened", "session", session_id)
    return session


@router.patch("", response_model=sessions.Session)
def change_session(
    session_id: Id,
    body: schemas.SessionChange,
    db: Db,
    user: Annotated[Identity, require(Action.WRITE_SESSION)],
) -> sessions.Session:
    """Change a session; omitted fields are unchanged."""
    with db.write() as c:
        return sessions.change(c, user, session_id, body.values())


@router.delete("", status_code=204)
def delete_session(
    session_id: Id,
    db: Db,
    reviewed: Reviewed,
    settings: Config,
    hub: LiveHub,
    user: Annotated[Identity, require(Action.DELETE_SESSION)],
) -> None:
    """Permanently delete a session with its recordings and results; only audit rows remain."""
    hub.drop_from_thread([session_id])
    erasure.erase_session(db, reviewed, settings, user, session_id)


@router.get("/recording", response_model=schemas.RecordingAnswer)
def read_recording(
    session_id: Id, db: Db, trail: OpenTrail, user: Annotated[Identity, require(Action.READ_SESSION)]
) -> schemas.RecordingAnswer:
    """The current upload set: files, inspection results and mapping."""
    with db.read() as c:
        recording = recordings.current(c, session_id)
    trail.record_watched(user, "recording.opened", "session", session_id)
    if recording is None:
        raise NotFound("recording of visit", session_id)
    return make_answer(schemas.RecordingAnswer, recording)


@router.put("/manifest", response_model=schemas.RecordingAnswer, responses=refusals(409))
def set_manifest(
    session_id: Id, body: schemas.Json, db: Db, user: Annotated[Identity, require(Action.UPLOAD)]
) -> schemas.RecordingAnswer:
    """Set the mapping (docs/reference/formats.md); the next analysis uses it."""
    with db.write() as c:
        return make_answer(schemas.RecordingAnswer, recordings.set_manifest(c, user, session_id, body))


@router.post("/inspections", status_code=202, response_model=JobView, responses=refusals(409))
def inspect(
    session_id: Id, db: Db, queue: Queue, blobs: Blobs, user: Annotated[Identity, require(Action.UPLOAD)]
) -> JobView:
    """Request an inspection of the files; tables of a known shape are mapped like earlier ones."""
    with db.read() as c:
        shapes = tables.find_known(c, blobs, session_id)
    with db.write() as c:
        for shape in shapes:
            tables.map_tables(c, user, session_id, shape.files, shape.source)
        return recordings.inspect(c, queue, user, session_id)
