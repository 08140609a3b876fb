"""The tablet's websocket: `WS /api/v1/live`, protocol sagittal.live.v1 (docs/reference/live-protocol.md).

Authorized by the trial's token in the first message; cookies are ignored.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from typing import Final, NoReturn

from fastapi import APIRouter, WebSocket
from starlette.websockets import WebSocketDisconnect

from sagittal.core.errors import InputError
from sagittal.core.formats.live_log import PROTOCOL, Hello
from sagittal.server.auth.access import require
from sagittal.server.auth.roles import Action
from sagittal.server.errors import NodeAway, NotFound
from sagittal.server.live import protocol
from sagittal.server.live.hub import Hub
from sagittal.server.live.intake import IntakeAnswer
from sagittal.server.live.protocol import HELLO_WITHIN_S, CloseCode, ProtocolError
from sagittal.server.live.take import ActiveTake
from sagittal.server.live_takes import live
from sagittal.server.nodes.forwarding import UnreachableError, carry_tablet
from sagittal.server.nodes.passage import ASKED_BY

router = APIRouter(include_in_schema=False)

UNREAD: Final = 256
"""Unread messages, not counting acknowledgements, after which a tablet is considered disconnected."""


class Tablet:
    """Outgoing messages of one tablet; later acknowledgements replace earlier ones."""

    def __init__(self, ws: WebSocket) -> None:
        self._ws = ws
        self._texts: deque[str] = deque(maxlen=UNREAD)
        self._ack: int | None = None
        self._closing: tuple[int, str] | None = None
        self._wake = asyncio.Event()

    def say(self, text: str) -> None:
        """Queue a message."""
        self._texts.append(text)
        self._wake.set()

    def ack(self, seq: int) -> None:
        """Queue an acknowledgement."""
        self._ack = seq
        self._wake.set()

    def shut(self, code: int, reason: str) -> None:
        """Send queued messages and close."""
        self._closing = self._closing or (code, reason)
        self._wake.set()

    async def send(self) -> None:
        """Send until closed."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            seq, self._ack = self._ack, None
            if seq is not None:
                await self._ws.send_text(protocol.ack(seq))
            while self._texts:
                await self._ws.send_text(self._texts.popleft())
            if self._closing is not None:
                await self._ws.close(*self._closing)
                return


@router.websocket("/live", dependencies=[require(Action.STREAM)])
async def stream(ws: WebSocket) -> None:
    """Receive the samples of one live trial."""
    offered = ws.scope.get("subprotocols", [])
    await ws.accept(subprotocol=PROTOCOL if PROTOCOL in offered else None)
    hub: Hub = ws.app.state.hub
    tablet = Tablet(ws)
    sending = asyncio.create_task(tablet.send())
    try:
        take = await _greeted(ws, hub, tablet)
        if take is None:
            await sending
            return
        receiving = asyncio.create_task(_receive(ws, take, tablet))
        try:
            await asyncio.wait((sending, receiving), return_when=asyncio.FIRST_COMPLETED)
        finally:
            hub.detach(take, tablet)
            receiving.cancel()
            await asyncio.gather(receiving, return_exceptions=True)
    except WebSocketDisconnect:
        pass
    finally:
        if not sending.done():
            sending.cancel()
        # the tablet may have disconnected
        await asyncio.gather(sending, return_exceptions=True)


def _not_valid() -> ProtocolError:
    return ProtocolError(
        "token_not_valid",
        "The token is not valid for this recording, or has expired; pair with a new code.",
        CloseCode.UNAUTHORISED,
    )


async def _greeted(ws: WebSocket, hub: Hub, tablet: Tablet) -> ActiveTake | None:
    """The trial named in the first message; None after an error, which has been queued."""
    try:
        async with asyncio.timeout(HELLO_WITHIN_S):
            message = await _message(ws)
        if message is None:
            raise WebSocketDisconnect
        hello = protocol.parse(message) if isinstance(message, str) else None
        if not isinstance(hello, Hello):
            raise ProtocolError("hello_missing", "The first message must be a hello.")
        row = await asyncio.to_thread(hub.rows.admit, hello.take, hello.token)
        if row is None:
            raise _not_valid()
        if not row.is_open:
            _say_over(tablet, row)
            return None
        if not hub.owner.has(row):
            await _carry(ws, hub, row, message)
        take = await hub.enter(row, hello)
    except TimeoutError:
        _refuse(
            tablet,
            ProtocolError("no_hello", "No hello message arrived in time; connect again.", CloseCode.NO_HELLO),
        )
    except ProtocolError as error:
        _refuse(tablet, error)
    except NotFound:  # erased in the meantime
        _refuse(tablet, _not_valid())
    except NodeAway as error:
        _refuse(tablet, ProtocolError(error.code, error.message, CloseCode.GOING_AWAY))
    except InputError as error:
        _refuse(tablet, ProtocolError(error.code, error.message))
    else:
        answer = take.recorder.greet(hello)
        _heed(tablet, take, answer)
        if answer.close is None:
            hub.attach(take, tablet)
            return take
    return None


async def _carry(ws: WebSocket, hub: Hub, row: live.LiveTakeRecord, first: str | bytes) -> NoReturn:
    """Relay the connection to the web server that owns the trial, until it ends; raises NodeAway."""
    node = None if ASKED_BY in ws.scope or row.node is None else hub.nodes.find(row.node)
    if node is None:
        raise NodeAway(row.node)
    try:
        await carry_tablet(hub.nodes, node, ws, first)
    except UnreachableError:
        hub.nodes.suspect(node)
        raise NodeAway(row.node) from None
    raise WebSocketDisconnect


async def _receive(ws: WebSocket, take: ActiveTake, tablet: Tablet) -> None:
    while True:
        message = await _message(ws)
        if message is None:
            return
        answer = take.offer(message)
        _heed(tablet, take, answer)
        if answer.close is not None:
            # later messages are not answered; the sender closes
            with contextlib.suppress(WebSocketDisconnect):
                while await _message(ws) is not None:
                    pass
            return


def _heed(tablet: Tablet, take: ActiveTake, answer: IntakeAnswer) -> None:
    """Carry out a response of the protocol state."""
    if answer.say is not None:
        tablet.say(answer.say)
    if answer.battery is not None:
        take.charge(answer.battery)
    if answer.ended is not None and take.recording_id is not None:
        tablet.say(protocol.announce_finish(take.recording_id, take.problem))
    if answer.close is not None:
        tablet.shut(answer.close, answer.reason)


def _say_over(tablet: Tablet, row: live.LiveTakeRecord) -> None:
    """Tell a tablet reconnecting to an ended trial the outcome."""
    if row.recording_id is not None:
        tablet.say(protocol.announce_finish(row.recording_id, row.problem))
        tablet.shut(CloseCode.DONE if row.state == "finished" else CloseCode.ENDED, "take_ended")
    else:
        _refuse(tablet, ProtocolError("take_ended", "This recording has ended.", CloseCode.ENDED))


def _refuse(tablet: Tablet, error: ProtocolError) -> None:
    tablet.say(protocol.error(error.code, error.message))
    tablet.shut(error.close, error.code)


async def _message(ws: WebSocket) -> str | bytes | None:
    """The next message, None if the tablet has disconnected."""
    event = await ws.receive()
    if event["type"] == "websocket.disconnect":
        return None
    data = event.get("bytes")
    return data if data is not None else event.get("text") or ""
