"""Orientation filters on a trial: list, references, requested comparisons and their files."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Path, Request
from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from sagittal.core.estimators import PaperReference
from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.api.downloads.downloads import ANY_FILE, attachment
from sagittal.server.api.uploads.files import RAW_BODY, read_size, receive_body
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import sessions
from sagittal.server.context import Blobs, Config, Db, Id, OpenTrail, Queue
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.jobs.queue import JobView
from sagittal.server.report.words.filter_list import FILTERS
from sagittal.server.results import filter_runs
from sagittal.server.uploads import recordings, reference_files

router = APIRouter(route_class=StrictJsonRoute, tags=["filters"])
references = APIRouter(prefix="/sessions/{session_id}/references", tags=["filters"])

Reader = Annotated[Identity, require(Action.READ_RESULT)]
Uploader = Annotated[Identity, require(Action.UPLOAD)]
FilterName = Annotated[str, Field(json_schema_extra={"enum": [f.name for f in FILTERS]})]
"""Documented as an enumeration; other names are rejected by the service with a message."""
ReferenceName = Annotated[str, Path(max_length=500, description="any Unicode")]


@dataclass(frozen=True)
class FilterAnswer:
    """An orientation filter; `name` identifies it in a comparison."""

    name: str
    label: Annotated[str, Field(description="what is only a reconstruction says so")]
    engine: Annotated[str, Field(description="E1 to E6, or Sagittal for our own")]
    grade: Annotated[
        str | None, Field(description="A exact, B from formulas, C reconstruction; null: our own")
    ]
    magnetometer: Annotated[str, Field(description="needed, optional or unused")]
    paper: PaperReference | None


class FilterRunNew(schemas.Request):
    """Filters to run on the displayed analysis, and the reference to compare with."""

    filters: Annotated[list[FilterName], Field(min_length=1, max_length=100)]
    magnetometer: bool = True
    reference: Annotated[str | None, Field(max_length=500, description="name of an uploaded reference")] = (
        None
    )


@dataclass(frozen=True)
class FilterRunAnswer:
    """A finished comparison of filters."""

    id: str
    analysis_id: str
    session_id: str
    job_id: str
    settings: dict[str, Any]
    reference_name: str | None
    reference_sha256: str | None
    code_version: str
    created_at: dt.datetime
    files: list[recordings.RecordedFile]


@router.get("/filters", response_model=list[FilterAnswer])
def list_filters(user: Annotated[Identity, require(Action.READ_API)]) -> list[FilterAnswer]:
    """List the orientation filters of this version, by engine."""
    return [schemas.make_answer(FilterAnswer, f) for f in FILTERS]


@router.post(
    "/sessions/{session_id}/filter-runs", status_code=202, response_model=JobView, responses=refusals(404)
)
def compare(
    session_id: Id,
    body: FilterRunNew,
    db: Db,
    queue: Queue,
    user: Annotated[Identity, require(Action.ANALYSE)],
) -> JobView:
    """Run filters on this trial as one job; identical requests are run once."""
    with db.write() as c:
        return filter_runs.submit(
            c,
            queue,
            user,
            session_id,
            filters=body.filters,
            magnetometer=body.magnetometer,
            reference=body.reference,
        )


@router.get("/sessions/{session_id}/filter-runs", response_model=list[FilterRunAnswer])
def list_runs(session_id: Id, db: Db, trail: OpenTrail, user: Reader) -> list[FilterRunAnswer]:
    """List finished comparisons of a session, newest first."""
    with db.read() as c:
        sessions.get(c, session_id)
        runs = filter_runs.of_session(c, session_id)
    trail.record_watched(user, "filter_runs.opened", "session", session_id)
    return [_shown(run) for run in runs]


@router.get("/filter-runs/{run_id}", response_model=FilterRunAnswer)
def read_run(run_id: Id, db: Db, trail: OpenTrail, user: Reader) -> FilterRunAnswer:
    """Inputs, version and result files of a comparison."""
    with db.read() as c:
        run = filter_runs.get(c, run_id)
    trail.record_opened(user, "filter_run.opened", "filter_run", run_id)
    return _shown(run)


@router.get(
    "/filter-runs/{run_id}/files/{name}",
    response_class=Response,
    responses=ANY_FILE,
)
def read_run_file(run_id: Id, name: str, db: Db, blobs: Blobs, trail: OpenTrail, user: Reader) -> Response:
    """Download a file of a comparison; its name contains the id of the comparison but no patient data."""
    with db.read() as c:
        run = filter_runs.get(c, run_id)
    content = filter_runs.file_bytes(blobs, run, name)
    trail.record_opened(user, "filter_run.file_opened", "filter_run", run_id, {"file": name})
    stem, dot, ending = name.rpartition(".")
    return attachment(content, f"{stem}-{run_id[:8]}{dot}{ending}")


@references.get("", response_model=list[recordings.RecordedFile])
def list_references(session_id: Id, db: Db, trail: OpenTrail, user: Reader) -> list[recordings.RecordedFile]:
    """List uploaded reference orientations of other systems."""
    with db.read() as c:
        rows = reference_files.list_files(c, session_id)
    trail.record_watched(user, "references.opened", "session", session_id)
    return rows


@references.put(
    "/{name:path}",
    status_code=201,
    response_model=recordings.RecordedFile,
    responses=refusals(413),
    openapi_extra={"requestBody": {"required": True, **RAW_BODY}},
)
async def put_reference(
    session_id: Id,
    name: ReferenceName,
    request: Request,
    settings: Config,
    db: Db,
    blobs: Blobs,
    user: Uploader,
) -> recordings.RecordedFile:
    """Add a reference, an OpenSim .sto file or a table of quaternions; the same name replaces it."""
    size = read_size(request, settings.max_file_bytes)
    upload = await run_in_threadpool(
        reference_files.receive_reference, db, blobs, settings, user, session_id, name, size
    )
    return await receive_body(request, upload)


@references.get(
    "/{name:path}",
    response_class=Response,
    responses={200: {"description": "The file", **RAW_BODY}},
)
def read_reference(
    session_id: Id, name: ReferenceName, db: Db, blobs: Blobs, trail: OpenTrail, user: Reader
) -> Response:
    """Download a reference, byte for byte."""
    with db.read() as c:
        content = reference_files.file_bytes(c, blobs, session_id, name)
    trail.record_opened(user, "reference.opened", "session", session_id)
    return attachment(content, name.rpartition("/")[2], "application/octet-stream")


@references.delete("/{name:path}", status_code=204)
def delete_reference(session_id: Id, name: ReferenceName, db: Db, user: Uploader) -> None:
    """Delete a reference; comparisons that used it are unchanged."""
    with db.write() as c:
        reference_files.remove(c, user, session_id, name)


def _shown(run: filter_runs.FilterRunRecord) -> FilterRunAnswer:
    files = [recordings.RecordedFile(name, blob.size, blob.sha256) for name, blob in run.files.items()]
    return schemas.make_answer(FilterRunAnswer, run, files=files)
