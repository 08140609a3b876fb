"""Analyses: request, list, and download their files."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter
from starlette.responses import Response

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.api.downloads.downloads import ANY_FILE, attachment
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import sessions
from sagittal.server.context import Blobs, Db, Id, OpenTrail, Queue
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.jobs.queue import JobView
from sagittal.server.results import analyses
from sagittal.server.uploads import recordings

router = APIRouter(route_class=StrictJsonRoute, tags=["analyses"])
Reader = Annotated[Identity, require(Action.READ_RESULT)]


@router.post(
    "/sessions/{session_id}/analyses", status_code=202, response_model=JobView, responses=refusals(409)
)
def analyse(
    session_id: Id,
    body: schemas.AnalysisNew,
    db: Db,
    queue: Queue,
    user: Annotated[Identity, require(Action.ANALYSE)],
) -> JobView:
    """Request an analysis; identical files, mapping, settings and version are analysed only once."""
    with db.write() as c:
        if body.manifest is not None:
            recordings.set_manifest(c, user, session_id, body.manifest)
        return analyses.submit(c, queue, user, session_id, config=body.config)


@router.get("/sessions/{session_id}/analyses", response_model=list[schemas.AnalysisAnswer])
def list_analyses(session_id: Id, db: Db, trail: OpenTrail, user: Reader) -> list[schemas.AnalysisAnswer]:
    """List finished analyses of a session, the displayed one first."""
    with db.read() as c:
        sessions.get(c, session_id)
        records = analyses.of_session(c, session_id)
    trail.record_watched(user, "analyses.opened", "session", session_id)
    return [_shown(record) for record in records]


@router.get("/analyses/{analysis_id}", response_model=schemas.AnalysisAnswer)
def read_analysis(analysis_id: Id, db: Db, trail: OpenTrail, user: Reader) -> schemas.AnalysisAnswer:
    """Inputs, version and result files of an analysis."""
    with db.read() as c:
        record = analyses.get(c, analysis_id)
    trail.record_opened(user, "analysis.opened", "analysis", analysis_id)
    return _shown(record)


@router.get(
    "/analyses/{analysis_id}/files/{name}",
    response_class=Response,
    responses=ANY_FILE,
)
def read_file(analysis_id: Id, name: str, db: Db, blobs: Blobs, trail: OpenTrail, user: Reader) -> Response:
    """Download a result file; its name contains the id of the analysis but no patient data."""
    with db.read() as c:
        record = analyses.get(c, analysis_id)
    content = analyses.file_bytes(blobs, record, name)
    trail.record_opened(user, "analysis.file_opened", "analysis", analysis_id, {"file": name})
    stem, dot, ending = name.rpartition(".")
    return attachment(content, f"{stem}-{analysis_id[:8]}{dot}{ending}")


def _shown(record: analyses.AnalysisRecord) -> schemas.AnalysisAnswer:
    files = [recordings.RecordedFile(name, blob.size, blob.sha256) for name, blob in record.files.items()]
    return schemas.make_answer(schemas.AnalysisAnswer, record, files=files)
