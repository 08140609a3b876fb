"""Websocket of a session for browsers: `WS /sessions/{sid}/live/feed`, JSON texts (docs/reference/api.md,
Live).

Messages are sent by the server only; commands use the API. Watching a streaming trial counts as activity, so
that users are not signed out during a training.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import Annotated

from fastapi import APIRouter, WebSocket
from sqlalchemy.exc import SQLAlchemyError
from starlette.status import WS_1008_POLICY_VIOLATION, WS_1012_SERVICE_RESTART
from starlette.websockets import WebSocketDisconnect

from sagittal.core.errors import SagittalError
from sagittal.server.auth.access import find_end, require, wait_for_end
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import sessions
from sagittal.server.context import Id, state_of
from sagittal.server.live.hub import MIND_S, Hub
from sagittal.server.live.messages import encode_json
from sagittal.server.live.room import BrowserQueue
from sagittal.server.nodes.pins import Pin, find_owner

router = APIRouter(include_in_schema=False)

GONE = 4404
"""Close code: the session does not exist (any more)."""


@router.websocket("/sessions/{sid}/live/feed")
async def feed(ws: WebSocket, sid: Id, user: Annotated[Identity, require(Action.RUN_LIVE)]) -> None:
    """Send updates of the session's live trial to a browser."""
    state = state_of(ws)
    hub, db = state.hub, state.db
    await ws.accept()

    def look() -> bytes:
        with db.read() as c:
            sessions.get(c, sid)
        state.trail.record_watched(user, "live.watched", "session", sid)
        return encode_json(hub.standing(sid))

    try:
        first = await asyncio.to_thread(look)
    except SagittalError as error:
        await ws.close(GONE, error.code)
        return
    room = hub.room(sid)
    with room.viewing() as viewer:
        viewer.put("state", first)
        tasks = [
            moved := asyncio.create_task(_until_moved(ws, sid)),
            over := asyncio.create_task(wait_for_end(lambda: _find_end(ws, hub, sid, user))),
            asyncio.create_task(_down(ws, viewer)),
            asyncio.create_task(_until_gone(ws)),
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            if over.done():
                with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                    await ws.close(WS_1008_POLICY_VIOLATION, over.result())
            elif moved.done():
                with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                    await ws.close(WS_1012_SERVICE_RESTART, "moved")
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
    hub.leave(sid)


async def _down(ws: WebSocket, viewer: BrowserQueue) -> None:
    while True:
        for message in await viewer.take():
            await ws.send_text(message.decode())


async def _until_moved(ws: WebSocket, sid: str) -> None:
    """Return when the session's trial moves to another web server; the browser then reconnects to that
    one.
    """
    state = state_of(ws)
    nodes = state.nodes
    while True:
        await asyncio.sleep(MIND_S)
        if not nodes.is_one_of_several:
            continue
        with contextlib.suppress(SQLAlchemyError):
            owner = await asyncio.to_thread(find_owner, state.db, nodes, Pin("session", sid))
            if owner is not None and owner.node is not None:
                return


async def _until_gone(ws: WebSocket) -> None:
    while (await ws.receive())["type"] != "websocket.disconnect":
        pass


def _find_end(ws: WebSocket, hub: Hub, sid: str, user: Identity) -> str | None:
    """Reason why the feed must end; a running live view counts as activity."""
    take = hub.take_of(sid)
    if take is not None and take.tablet is not None:
        state_of(ws).logins.touch(user.login_id)
    return find_end(ws)
