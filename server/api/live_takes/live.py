"""Live trials of a session: open, pair, command, end; for the sockets see server/live."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Request
from starlette.concurrency import run_in_threadpool

from sagittal.server.api.documents import PUBLIC, refusals
from sagittal.server.api.live_takes import live_schemas as schemas
from sagittal.server.api.schemas import make_answer
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import sessions
from sagittal.server.context import Db, Failures, Id, LiveHub, OpenTrail, address_of
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.live_takes import live, live_events

router = APIRouter(route_class=StrictJsonRoute, tags=["live"])
Therapist = Annotated[Identity, require(Action.RUN_LIVE)]
SOCKET = "/api/v1/live"


@router.post(
    "/sessions/{session_id}/live", status_code=201, response_model=schemas.OpenedTake, responses=refusals(409)
)
async def open_take(session_id: Id, db: Db, hub: LiveHub, user: Therapist) -> schemas.OpenedTake:
    """Open a live trial; a tablet joins it with the code within ten minutes."""

    def write() -> tuple[live.LiveTakeRecord, str]:
        with db.write() as c:
            return live.open_take(c, user, session_id, hub.owner)

    take, code = await run_in_threadpool(write)
    hub.tell_row(take)
    return _opened(take, code)


@router.get("/sessions/{session_id}/live", response_model=schemas.LiveState)
def read_take(session_id: Id, db: Db, hub: LiveHub, trail: OpenTrail, user: Therapist) -> dict[str, Any]:
    """State of the session's latest live trial."""
    with db.read() as c:
        sessions.get(c, session_id)
    trail.record_watched(user, "live.watched", "session", session_id)
    return hub.standing(session_id)


@router.post(
    "/sessions/{session_id}/live/code",
    status_code=201,
    response_model=schemas.OpenedTake,
    responses=refusals(409),
)
async def give_code(session_id: Id, db: Db, hub: LiveHub, user: Therapist) -> schemas.OpenedTake:
    """Issue another pairing code, which replaces the previous one; using it disconnects the earlier
    tablet.
    """

    def write() -> tuple[live.LiveTakeRecord, str]:
        with db.write() as c:
            return live.new_code(c, user, session_id)

    take, code = await run_in_threadpool(write)
    hub.tell_row(take)
    return _opened(take, code)


@router.post(
    "/sessions/{session_id}/live/commands", response_model=schemas.LiveState, responses=refusals(409)
)
async def give_command(
    session_id: Id, body: schemas.LiveCommand, hub: LiveHub, user: Therapist
) -> dict[str, Any]:
    """Carry out a command; it is stored with its time and author."""
    return await hub.command(user, session_id, body.command, body.value, body.t_s)


@router.post("/sessions/{session_id}/live/close", response_model=schemas.TakeAnswer, responses=refusals(409))
async def close_take(session_id: Id, hub: LiveHub, user: Therapist) -> schemas.TakeAnswer:
    """End the trial without the tablet; the received data become the session's recording and are analysed."""
    return make_answer(schemas.TakeAnswer, await hub.close(user, session_id))


@router.get("/sessions/{session_id}/live/events", response_model=list[live_events.LiveEvent])
def list_events(session_id: Id, db: Db, trail: OpenTrail, user: Therapist) -> list[live_events.LiveEvent]:
    """List events of the session's live trials in order."""
    with db.read() as c:
        sessions.get(c, session_id)
        rows = [event for take in live.takes_of(c, session_id) for event in live_events.events(c, take.id)]
    trail.record_watched(user, "live.events_opened", "session", session_id)
    return rows


@router.post(
    "/live/pairings",
    status_code=201,
    dependencies=[require(Action.PAIR)],
    response_model=schemas.PairedTablet,
    responses=refusals(404, 429),
    openapi_extra=PUBLIC,
)
async def pair(
    request: Request, body: schemas.PairingCode, db: Db, hub: LiveHub, trail: OpenTrail, failures: Failures
) -> schemas.PairedTablet:
    """Join a tablet to a trial by its single-use code."""
    # counted per address: a stranger cannot block other tablets by guessing
    address = address_of(request)
    client = f"pairing from {address}"
    await run_in_threadpool(failures.check, client, address)

    def write() -> tuple[live.TabletAccess, live.LiveTakeRecord]:
        with db.write() as c:
            paired = live.pair(c, body.code)
            return paired, live.get(c, paired.take)

    try:
        paired, take = await run_in_threadpool(write)
    except live.CodeNotValid:
        await run_in_threadpool(failures.fail, client, address)
        await run_in_threadpool(trail.record_refused, "live.pairing_failed", "live", None, address)
        raise
    await run_in_threadpool(failures.succeed, client, address)
    hub.tell_row(take)
    return make_answer(schemas.PairedTablet, paired, socket=SOCKET)


def _opened(take: live.LiveTakeRecord, code: str) -> schemas.OpenedTake:
    return make_answer(schemas.OpenedTake, take, code=code, expires_at=take.code_expires_at)
