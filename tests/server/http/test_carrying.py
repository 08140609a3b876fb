"""Messages of a websocket are carried to another server and back, and so is its end."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any

import pytest
from starlette.websockets import WebSocket
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve

from sagittal.server.http.carrying import Message, carry_messages

pytestmark = pytest.mark.anyio


async def answer(up: ServerConnection) -> None:
    """Answer every message; at certain words end the line."""
    async for message in up:
        if message == "go":
            await up.close(4321, "went")
        elif message == "die":
            up.transport.abort()
        else:
            await up.send(message if isinstance(message, bytes) else message[::-1])


async def carry(*notices: Any, stay: bool = True, **options: Any) -> list[dict[str, Any]]:
    """Response received by a client that sends these headers; with `stay` it waits for the end."""
    sent: list[dict[str, Any]] = []
    waiting: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
    waiting.put_nowait({"type": "websocket.connect"})
    for one in notices:
        waiting.put_nowait({"type": "websocket.receive", "bytes" if isinstance(one, bytes) else "text": one})

    async def send(message: Any) -> None:
        sent.append(message)
        answers = sum(m["type"] == "websocket.send" for m in sent)
        if not stay and answers == len(notices):
            waiting.put_nowait({"type": "websocket.disconnect", "code": 1001})

    ws = WebSocket({"type": "websocket", "headers": [], "path": "/"}, waiting.get, send)
    async with serve(answer, "127.0.0.1", 0) as server, asyncio.timeout(10):
        port = server.sockets[0].getsockname()[1]
        async with connect(f"ws://127.0.0.1:{port}", proxy=None) as up:
            await ws.accept()
            await carry_messages(ws, up, **options)
            await up.close()
    return sent


def got(sent: list[dict[str, Any]]) -> list[Message]:
    return [
        m["text"] if m.get("text") is not None else m["bytes"] for m in sent if m["type"] == "websocket.send"
    ]


def end(sent: list[dict[str, Any]]) -> list[tuple[int, str]]:
    return [(m["code"], m["reason"]) for m in sent if m["type"] == "websocket.close"]


async def test_text_and_bytes_go_both_ways_until_the_other_side_ends() -> None:
    sent = await carry("abc", b"\x00\xff", "", "go")
    assert got(sent) == ["cba", b"\x00\xff", ""]
    assert end(sent) == [(4321, "went")]


async def test_an_end_without_a_code_is_an_ordinary_one() -> None:
    assert end(await carry("die")) == [(1000, "")]


async def test_only_what_is_admitted_is_passed_on() -> None:
    sent = await carry("secret", "abc", "go", admits=lambda m: m != "secret")
    assert got(sent) == ["cba"]


async def test_a_client_that_goes_ends_it() -> None:
    assert got(await carry("abc", stay=False)) == ["cba"]


async def test_the_right_to_see_ends_it_with_the_reason() -> None:
    async def over() -> str:
        return "signed out"

    until: Coroutine[Any, Any, str] = over()
    assert end(await carry(until=until)) == [(1008, "signed out")]
