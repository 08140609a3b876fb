"""Resumable upload of large files in parts (docs/reference/api.md, "Large files")."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Header, Request, Response
from pydantic import Field, StringConstraints
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.api.uploads.files import RAW_BODY, read_megabytes, read_size
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Blobs, Config, Db, Id, OpenTrail
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.http.problems import Problem
from sagittal.server.uploads import recordings, uploads

router = APIRouter(route_class=StrictJsonRoute, prefix="/sessions/{session_id}/uploads", tags=["files"])

Offset = Annotated[
    int, Header(alias="Upload-Offset", ge=0, le=1 << 53, description="place of the first byte in the file")
]
TELLS = {
    "Upload-Offset": {"description": "bytes on the server's disk", "schema": {"type": "integer"}},
    "Upload-Length": {"description": "bytes of the whole file", "schema": {"type": "integer"}},
}


class UploadAnnouncement(schemas.Request):
    """A file to be uploaded in parts."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=500)]
    size: Annotated[int, Field(ge=1, le=1 << 53, description="bytes")]


class UploadEnd(schemas.Request):
    """Checksum of the complete file."""

    sha256: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]


@router.post("", status_code=201, response_model=uploads.FileUpload, responses=refusals(413))
def begin_upload(
    session_id: Id,
    body: UploadAnnouncement,
    settings: Config,
    db: Db,
    blobs: Blobs,
    user: Annotated[Identity, require(Action.UPLOAD)],
) -> uploads.FileUpload:
    """Announce a file, or find its unfinished upload by name and size: see its `offset`."""
    return uploads.begin(db, blobs, settings, user, session_id, body.name, body.size)


@router.get("", response_model=list[uploads.FileUpload])
def list_uploads(
    session_id: Id,
    db: Db,
    blobs: Blobs,
    trail: OpenTrail,
    user: Annotated[Identity, require(Action.UPLOAD)],
) -> list[uploads.FileUpload]:
    """List the session's unfinished uploads."""
    with db.read() as c:
        recordings.patient_of(c, session_id)
        coming = uploads.list_coming(c, blobs, session_id)
    trail.record_opened(user, "uploads.opened", "session", session_id)
    return coming


@router.head(
    "/{upload_id}",
    response_class=Response,
    responses={200: {"description": "How far it is", "headers": TELLS}},
    dependencies=[require(Action.UPLOAD)],
)
def tell_offset(session_id: Id, upload_id: Id, db: Db, blobs: Blobs) -> Response:
    """Number of bytes on disk, which is the offset of the next part."""
    with db.read() as c:
        this = uploads.get(c, blobs, session_id, upload_id)
    return Response(headers={"Upload-Offset": str(this.offset), "Upload-Length": str(this.size)})


@router.patch(
    "/{upload_id}",
    response_model=uploads.FileUpload,
    responses=refusals(409, 413),
    openapi_extra={"requestBody": {"required": True, **RAW_BODY}},
    dependencies=[require(Action.UPLOAD)],
)
async def add_part(
    session_id: Id,
    upload_id: Id,
    offset: Offset,
    request: Request,
    settings: Config,
    db: Db,
    blobs: Blobs,
) -> uploads.FileUpload:
    """Append the raw body; of an interrupted body, complete megabytes are retained."""
    read_size(request, settings.max_file_bytes)

    def keep(offset: int, piece: bytes) -> uploads.FileUpload:
        return uploads.add_part(db, blobs, settings, session_id, upload_id, offset, piece)

    # rejected before the first byte is received
    this = await run_in_threadpool(keep, offset, b"")
    try:
        async for piece in read_megabytes(request):
            this = await run_in_threadpool(keep, this.offset, piece)
    except ClientDisconnect:
        raise Problem(
            400,
            "upload_cut",
            "The connection was lost during this part. Query the offset and resume from there.",
        ) from None
    return this


@router.post("/{upload_id}/finish", response_model=recordings.RecordedFile, responses=refusals(409, 413))
def finish_upload(
    session_id: Id,
    upload_id: Id,
    body: UploadEnd,
    settings: Config,
    db: Db,
    blobs: Blobs,
    user: Annotated[Identity, require(Action.UPLOAD)],
) -> recordings.RecordedFile:
    """Verify the complete file and add it to the current recording; the same name replaces one."""
    return uploads.finish(db, blobs, settings, user, session_id, upload_id, body.sha256)


@router.delete("/{upload_id}", status_code=204)
def cancel_upload(
    session_id: Id, upload_id: Id, db: Db, blobs: Blobs, user: Annotated[Identity, require(Action.UPLOAD)]
) -> None:
    """Abandon an upload and delete its data."""
    uploads.cancel(db, blobs, user, session_id, upload_id)
