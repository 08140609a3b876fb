"""The browsers' socket of a session: `WS /sessions/{sid}/live/feed`, JSON texts (docs/api.md, Live).

Only goes down; commands come over the API. While a take streams, watching it counts as activity: nobody is
signed out in the middle of a training.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import Annotated

import msgspec
from fastapi import APIRouter, WebSocket
from starlette.status import WS_1008_POLICY_VIOLATION
from starlette.websockets import WebSocketDisconnect

from core.errors import SagittalError
from server.auth.access import require, still_opens
from server.auth.identity import Identity
from server.auth.roles import Action
from server.auth.sessions import CHECK_EVERY_S
from server.context import Id
from server.live.hub import Hub
from server.live.room import BrowserQueue
from server.services import sessions

router = APIRouter(include_in_schema=False)

GONE = 4404
"""Close code: there is no such session (any more)."""


@router.websocket("/sessions/{sid}/live/feed")
async def feed(ws: WebSocket, sid: Id, who: Annotated[Identity, require(Action.RUN_LIVE)]) -> None:
    """Tell a browser what happens."""
    hub: Hub = ws.app.state.hub
    db = ws.app.state.db
    await ws.accept()

    def look() -> bytes:
        with db.read() as c:
            sessions.get(c, sid)
        ws.app.state.trail.record_watched(who, "live.watched", "session", sid)
        return msgspec.json.encode(hub.standing(sid))

    try:
        first = await asyncio.to_thread(look)
    except SagittalError as error:
        await ws.close(GONE, error.code)
        return
    room = hub.room(sid)
    with room.viewing() as viewer:
        viewer.put("state", first)
        tasks = [
            asyncio.create_task(_down(ws, viewer)),
            asyncio.create_task(_until_gone(ws)),
            asyncio.create_task(_until_signed_out(ws, hub, sid, who)),
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            if tasks[2].done():
                with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                    await ws.close(WS_1008_POLICY_VIOLATION, "not_signed_in")
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
    hub.leave(sid)


async def _down(ws: WebSocket, viewer: BrowserQueue) -> None:
    while True:
        for message in await viewer.take():
            await ws.send_text(message.decode())


async def _until_gone(ws: WebSocket) -> None:
    while (await ws.receive())["type"] != "websocket.disconnect":
        pass


async def _until_signed_out(ws: WebSocket, hub: Hub, sid: str, who: Identity) -> None:
    logins = ws.app.state.logins
    while True:
        await asyncio.sleep(CHECK_EVERY_S)
        take = hub.take_of(sid)
        streams = take is not None and take.tablet is not None
        check = logins.touch if streams else logins.is_open
        if not await asyncio.to_thread(check, who.login_id) or not await asyncio.to_thread(still_opens, ws):
            return
