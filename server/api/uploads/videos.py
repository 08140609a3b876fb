"""Video of a trial."""

from __future__ import annotations

from functools import partial
from typing import Annotated

from fastapi import APIRouter, Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response, StreamingResponse

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.api.downloads.downloads import BINARY
from sagittal.server.api.uploads.files import RAW_BODY, read_size, receive_body
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Blobs, Config, Db, Id, OpenTrail
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.http.ranges import answer_range
from sagittal.server.uploads import recordings, videos

router = APIRouter(route_class=StrictJsonRoute, prefix="/sessions/{session_id}/video", tags=["sessions"])
Reader = Annotated[Identity, require(Action.READ_RESULT)]
Writer = Annotated[Identity, require(Action.WRITE_SESSION)]


@router.get("", response_model=videos.SessionVideo)
def read_video(session_id: Id, db: Db, trail: OpenTrail, user: Reader) -> videos.SessionVideo:
    """Properties of the video, and the user who confirmed the patient's consent."""
    with db.read() as c:
        video = videos.get(c, session_id)
    trail.record_watched(user, "video.opened", "session", session_id)
    return video


@router.put(
    "",
    status_code=201,
    response_model=recordings.RecordedFile,
    responses=refusals(413),
    openapi_extra={"requestBody": {"required": True, **RAW_BODY}},
)
async def put_video(
    session_id: Id,
    name: Annotated[str, Query(min_length=1, max_length=200)],
    consent: Annotated[bool, Query(description="the person agreed to be filmed; it is kept who said so")],
    request: Request,
    settings: Config,
    db: Db,
    blobs: Blobs,
    user: Writer,
) -> recordings.RecordedFile:
    """Attach a video to the trial, MP4, QuickTime or WebM; replaces the previous one."""
    size = read_size(request, settings.max_file_bytes)

    def begin() -> videos.receive_video:
        videos.require_consent(consent)
        return videos.receive_video(db, blobs, settings, user, session_id, name, size)

    return await receive_body(request, await run_in_threadpool(begin))


@router.patch("", response_model=videos.SessionVideo)
def align_video(session_id: Id, body: schemas.VideoAlignment, db: Db, user: Writer) -> videos.SessionVideo:
    """Set the video time that corresponds to trial time 0."""
    with db.write() as c:
        return videos.align(c, user, session_id, body.offset_s)


@router.delete("", status_code=204)
def remove_video(session_id: Id, db: Db, user: Writer) -> None:
    """Remove the video."""
    with db.write() as c:
        videos.remove(c, user, session_id)


@router.get(
    "/content",
    response_class=StreamingResponse,
    responses={
        200: {"description": "The video, or the range of it", "content": {"video/*": {"schema": BINARY}}}
    },
)
def play_video(
    request: Request, session_id: Id, db: Db, blobs: Blobs, trail: OpenTrail, user: Reader
) -> Response:
    """Content of the video; supports range requests."""
    with db.read() as c:
        video, space = videos.find_stored(c, blobs, session_id)
    trail.record_watched(user, "video.opened", "session", session_id)
    read = partial(blobs.read_part, space, video.sha256)
    return answer_range(request.headers, video.size, video.sha256, read, video.media_type)
