"""Chunked upload of the tablet's video (docs/reference/live-protocol.md), authorized by the trial's token."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Header, Path, Request
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from sagittal.core.message import Message
from sagittal.server.api.documents import PUBLIC, refusals
from sagittal.server.api.live_takes import live_schemas as schemas
from sagittal.server.api.uploads.files import RAW_BODY, read_size
from sagittal.server.auth.access import require
from sagittal.server.auth.roles import Action
from sagittal.server.context import Films, Id
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.http.problems import Problem
from sagittal.server.live_takes import films

router = APIRouter(
    route_class=StrictJsonRoute,
    prefix="/live/takes/{take_id}/film",
    tags=["live"],
    dependencies=[require(Action.STREAM)],
)


def _read_token(
    authorization: Annotated[str, Header(description="Bearer and the token that the code gave")] = "",
) -> str:
    if not authorization:
        raise films.TokenNotValid
    return authorization.removeprefix("Bearer ")


Token = Annotated[str, Depends(_read_token)]


@router.post("", response_model=films.FilmProgress, responses=refusals(401), openapi_extra=PUBLIC)
def begin_film(take_id: Id, body: schemas.FilmBeginning, token: Token, intake: Films) -> films.FilmProgress:
    """Start the video of a trial, or query its progress; the user who confirmed consent is recorded."""
    return intake.begin(take_id, token, body.began_us, consent=body.consent)


@router.put(
    "/{number}",
    response_model=films.FilmProgress,
    responses=refusals(401, 409, 413),
    openapi_extra={**PUBLIC, "requestBody": {"required": True, **RAW_BODY}},
)
async def add_piece(
    take_id: Id,
    number: Annotated[int, Path(ge=0, le=1_000_000, description="0, 1, …")],
    request: Request,
    token: Token,
    intake: Films,
) -> films.FilmProgress:
    """Add a chunk; the response follows once it is on disk. Repeated chunks are accepted, gaps rejected."""
    read_size(request, films.MOST_PIECE_BYTES)
    piece = bytearray()
    try:
        async for some in request.stream():
            piece += some
            if len(piece) > films.MOST_PIECE_BYTES:
                raise Problem(
                    413,
                    "file_too_large",
                    Message(
                        "A piece has at most {MOST_PIECE_BYTES} bytes; split it.",
                        MOST_PIECE_BYTES=films.MOST_PIECE_BYTES,
                    ),
                )
    except ClientDisconnect:
        raise Problem(
            400, "upload_cut", "The connection was lost during this piece. Send it again."
        ) from None
    return await run_in_threadpool(intake.add, take_id, token, number, bytes(piece))


@router.post("/end", response_model=schemas.EndedFilm, responses=refusals(401, 409), openapi_extra=PUBLIC)
def end_film(take_id: Id, token: Token, intake: Films) -> schemas.EndedFilm:
    """Attach the video to its trial after the trial ended; discarded if there is no recording."""
    return schemas.EndedFilm(kept=intake.end(take_id, token))
