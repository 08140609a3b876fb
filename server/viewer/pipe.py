"""Carries messages between a browser and a viser server, and keeps out what a viewer need not send."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import msgspec
from starlette.status import WS_1008_POLICY_VIOLATION
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect, unix_connect
from websockets.exceptions import ConnectionClosed

from server.auth.sessions import CHECK_EVERY_S

ALLOWED: Final = frozenset({"ViewerCameraMessage"})
"""Types of messages a browser may send to viser; everything else, such as a request to share, is dropped."""


def find_subprotocols(ws: WebSocket) -> list[str]:
    """Return the subprotocols the browser offers that are viser's."""
    return [p for p in ws.scope.get("subprotocols", []) if p.startswith("viser-v")]


def connect_to_viser(socket: Path, subprotocols: list[str]) -> connect:
    """Return a connection to the viser server on a socket, without proxy, compression or size limit."""
    return unix_connect(
        str(socket),
        subprotocols=subprotocols,
        max_size=None,
        compression=None,
        proxy=None,
    )


async def carry_messages(ws: WebSocket, up: ClientConnection, is_open: Callable[[], bool]) -> None:
    """Carry messages both ways until one side ends or the sign-in does; the close code is passed on.

    Parameters
    ----------
    is_open : asked in a thread every `CHECK_EVERY_S`.
    """
    tasks = [asyncio.create_task(c) for c in (_down(ws, up), _upward(ws, up), wait_for_sign_out(is_open))]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        over = tasks[2].done()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        code, reason = (WS_1008_POLICY_VIOLATION, "not_signed_in") if over else _close_code(up)
        # the browser may be gone already
        with contextlib.suppress(RuntimeError, WebSocketDisconnect):
            await ws.close(code, reason)


async def wait_for_sign_out(is_open: Callable[[], bool]) -> None:
    """Return when the sign-in has ended."""
    while True:
        await asyncio.sleep(CHECK_EVERY_S)
        if not await asyncio.to_thread(is_open):
            return


class ViewActivity:
    """Counts use of a view as activity of the sign-in, at most every `CHECK_EVERY_S`."""

    def __init__(self, touch: Callable[[], object]) -> None:
        self._touch = touch
        self._last = time.monotonic()

    async def note_activity(self) -> None:
        """Note that the person did something."""
        now = time.monotonic()
        if now - self._last >= CHECK_EVERY_S:
            self._last = now
            await asyncio.to_thread(self._touch)


def is_allowed(message: bytes) -> bool:
    """Tell whether a message of the browser may reach viser."""
    try:
        content = msgspec.msgpack.decode(message)
    except msgspec.DecodeError:
        return False
    return isinstance(content, dict) and content.get("type") in ALLOWED


async def _down(ws: WebSocket, up: ClientConnection) -> None:
    async for message in up:
        await ws.send_bytes(message if isinstance(message, bytes) else message.encode())


async def _upward(ws: WebSocket, up: ClientConnection) -> None:
    while True:
        event = await ws.receive()
        if event["type"] == "websocket.disconnect":
            return
        message = event.get("bytes")
        if message is not None and is_allowed(message):
            with contextlib.suppress(ConnectionClosed):
                await up.send(message)


def _close_code(up: ClientConnection) -> tuple[int, str]:
    """Code and reason to give to the browser; 1005 and 1006 mean "none given" and may not be sent."""
    code = up.close_code
    return (1000, "") if code is None or code in (1005, 1006) else (code, up.close_reason or "")
