"""Relays websocket messages to another server and back."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine
from typing import Any

from starlette.status import WS_1008_POLICY_VIOLATION
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed

Message = str | bytes


async def carry_messages(
    ws: WebSocket,
    up: ClientConnection,
    *,
    admits: Callable[[Message], bool] = lambda _: True,
    until: Coroutine[Any, Any, str] | None = None,
) -> None:
    """Relay messages in both directions until one side closes or access ends; the close code is forwarded.

    Parameters
    ----------
    admits : filter for messages of the client. until : completes with a reason when the relay must end.
    """
    over = None if until is None else asyncio.create_task(until)
    tasks = [asyncio.create_task(_down(ws, up)), asyncio.create_task(_upward(ws, up, admits))]
    tasks += [] if over is None else [over]  # type: ignore[list-item]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        end_reason = over.result() if over is not None and over.done() else None
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        code, reason = _close_code(up) if end_reason is None else (WS_1008_POLICY_VIOLATION, end_reason)
        # the client may have disconnected
        with contextlib.suppress(RuntimeError, WebSocketDisconnect):
            await ws.close(code, reason)


async def _down(ws: WebSocket, up: ClientConnection) -> None:
    async for message in up:
        if isinstance(message, bytes):
            await ws.send_bytes(message)
        else:
            await ws.send_text(message)


async def _upward(ws: WebSocket, up: ClientConnection, admits: Callable[[Message], bool]) -> None:
    while True:
        event = await ws.receive()
        if event["type"] == "websocket.disconnect":
            return
        data = event.get("bytes")
        message: Message = data if data is not None else event.get("text") or ""
        if admits(message):
            with contextlib.suppress(ConnectionClosed):
                await up.send(message)


def _close_code(up: ClientConnection) -> tuple[int, str]:
    """Close code and reason for the client; 1005 and 1006 mean "none given" and must not be sent."""
    code = up.close_code
    return (1000, "") if code is None or code in (1005, 1006) else (code, up.close_reason or "")
