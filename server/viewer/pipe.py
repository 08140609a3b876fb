"""Relay between a browser and a viser server, which filters messages that a viewer need not send."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
from starlette.websockets import WebSocket
from websockets.asyncio.client import connect, unix_connect

from sagittal.server.auth.sessions import CHECK_EVERY_S
from sagittal.server.viewer.viser_adapter import ALLOWED


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


class ViewActivity:
    """Counts use of a view as activity of the sign-in, at most every `CHECK_EVERY_S`."""

    def __init__(self, touch: Callable[[], object]) -> None:
        self._touch = touch
        self._last = time.monotonic()

    async def note_activity(self) -> None:
        """Register user activity."""
        now = time.monotonic()
        if now - self._last >= CHECK_EVERY_S:
            self._last = now
            await asyncio.to_thread(self._touch)


def is_allowed(message: str | bytes) -> bool:
    """Whether a browser message may be forwarded to viser."""
    try:
        content = msgspec.msgpack.decode(message) if isinstance(message, bytes) else None
    except msgspec.DecodeError:
        return False
    return isinstance(content, dict) and content.get("type") in ALLOWED
