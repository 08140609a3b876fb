"""Original files of a session: streamed in constant memory and stored byte for byte."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Path, Request
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.requests import ClientDisconnect
from starlette.responses import Response

from sagittal.core.message import Message
from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.api.downloads.downloads import BINARY, attachment
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Blobs, Config, Db, Id, OpenTrail
from sagittal.server.http.problems import Problem
from sagittal.server.uploads import receiving, recordings

router = APIRouter(prefix="/sessions/{session_id}/files", tags=["files"])

CHUNK_BYTES = 1_000_000
"""One thread hop and one write per megabyte, independent of network packets."""

FileName = Annotated[str, Path(max_length=2000, description="with folders; any Unicode")]
RAW_BODY = {"content": {"application/octet-stream": {"schema": BINARY}}}
_FORM = {
    "content": {
        "multipart/form-data": {
            "schema": {
                "type": "object",
                "properties": {"files": {"type": "array", "items": BINARY, "minItems": 1}},
                "required": ["files"],
            }
        }
    }
}


@router.put(
    "/{name:path}",
    status_code=201,
    response_model=recordings.RecordedFile,
    responses=refusals(413),
    openapi_extra={"requestBody": {"required": True, **RAW_BODY}},
)
async def put_file(
    session_id: Id,
    name: FileName,
    request: Request,
    settings: Config,
    db: Db,
    blobs: Blobs,
    user: Annotated[Identity, require(Action.UPLOAD)],
) -> recordings.RecordedFile:
    """Add a file with the raw body as its content to the current recording; the same name replaces it."""
    size = read_size(request, settings.max_file_bytes)
    upload = await run_in_threadpool(receiving.receive, db, blobs, settings, user, session_id, name, size)
    return await receive_body(request, upload)


@router.post(
    "",
    status_code=201,
    response_model=list[recordings.RecordedFile],
    responses=refusals(411, 413),
    openapi_extra={"requestBody": {"required": True, **_FORM}},
)
async def post_files(
    session_id: Id,
    request: Request,
    settings: Config,
    db: Db,
    blobs: Blobs,
    user: Annotated[Identity, require(Action.UPLOAD)],
) -> list[recordings.RecordedFile]:
    """Add files from a form with the field `files`; a rejected file ends the request."""
    if "content-length" not in request.headers:
        raise Problem(
            411, "length_required", "A form upload must state its length. Send a Content-Length header."
        )
    # boundaries and part headers take some hundred bytes per file
    size = read_size(request, settings.max_set_bytes + 1000 * settings.max_files)
    if not request.headers.get("content-type", "").startswith("multipart/form-data"):
        raise Problem(422, "no_form", "Expected multipart/form-data with the field 'files'.")
    await run_in_threadpool(receiving.require_room, blobs, settings, size)
    parser = MultiPartParser(
        request.headers, request.stream(), max_files=settings.max_files, max_fields=settings.max_files
    )
    try:
        form = await parser.parse()
    except ClientDisconnect:
        raise _cut() from None
    except (MultiPartException, KeyError) as error:
        detail = "The form cannot be read. Send multipart/form-data with the field 'files'."
        raise Problem(400, "bad_form", detail) from error
    try:
        parts = [part for part in form.getlist("files") if isinstance(part, UploadFile)]
        if not parts:
            raise Problem(422, "no_files", "The form has no file in the field 'files'. Choose at least one.")
        stored = []
        for part in parts:
            upload = await run_in_threadpool(
                receiving.receive, db, blobs, settings, user, session_id, part.filename or ""
            )
            with upload:
                while chunk := await part.read(CHUNK_BYTES):
                    await run_in_threadpool(upload.write, chunk)
                stored.append(await run_in_threadpool(upload.keep))
        return stored
    finally:
        await form.close()


@router.get(
    "/{name:path}",
    response_class=Response,
    responses={200: {"description": "The file", **RAW_BODY}},
)
def read_file(
    session_id: Id,
    name: FileName,
    db: Db,
    blobs: Blobs,
    trail: OpenTrail,
    user: Annotated[Identity, require(Action.READ_RESULT)],
) -> Response:
    """Download an original file, byte for byte."""
    with db.read() as c:
        recording = recordings.require_current(c, session_id)
        content = recordings.file_bytes(c, blobs, recording.id, name)
    trail.record_opened(user, "recording.file_opened", "recording", recording.id)
    return attachment(content, name.rpartition("/")[2], "application/octet-stream")


@router.delete("/{name:path}", response_model=schemas.RecordingAnswer)
def delete_file(
    session_id: Id, name: FileName, db: Db, user: Annotated[Identity, require(Action.UPLOAD)]
) -> schemas.RecordingAnswer:
    """Remove a file from the current recording; existing analyses keep theirs."""
    with db.write() as c:
        return schemas.make_answer(schemas.RecordingAnswer, recordings.remove_file(c, user, session_id, name))


async def receive_body(request: Request, upload: receiving.receive) -> recordings.RecordedFile:
    """Store the raw body of a request as a file."""
    with upload:
        try:
            async for chunk in read_megabytes(request):
                await run_in_threadpool(upload.write, chunk)
        except ClientDisconnect:
            raise _cut() from None
        return await run_in_threadpool(upload.keep)


def read_size(request: Request, limit: int) -> int:
    """Return the announced body size in bytes, 0 = unknown; raise Problem 413 if it exceeds the limit."""
    declared = request.headers.get("content-length", "0")
    if not declared.isdecimal() or int(declared) > limit:
        raise Problem(
            413,
            "file_too_large",
            Message(
                "The body has {declared} bytes, at most {limit} are taken. Split the recording or "
                "ask the administrator (SAGITTAL_MAX_FILE_BYTES).",
                declared=declared,
                limit=limit,
            ),
        )
    return int(declared)


async def read_megabytes(request: Request) -> AsyncIterator[bytes]:
    """Yield the raw body of a request in parts of a megabyte; raises ClientDisconnect."""
    pending = bytearray()
    async for piece in request.stream():
        pending += piece
        if len(pending) >= CHUNK_BYTES:
            yield bytes(pending)
            pending.clear()
    if pending:
        yield bytes(pending)


def _cut() -> Problem:
    return Problem(
        400, "upload_cut", "The connection was lost before the file was complete. Upload it again."
    )
