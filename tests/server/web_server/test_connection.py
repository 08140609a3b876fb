"""Half requests, slow bodies, unread answers and too many guests, sent to a real server over real sockets."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path

import httpx
import pytest
from starlette.types import Message, Receive, Scope, Send

from sagittal.server.live.protocol import MOST_MESSAGE_BYTES
from tests.helpers.clinic import Clinic, open_clinic
from tests.server.serving import serve, serving

pytestmark = pytest.mark.anyio
SOON_S = 10.0
"""Longest wait for what must happen; without it a failure would wait for ever."""
WINDOW_S = 0.2
LARGE = 40_000_000
REQUEST = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
HALF_HEAD = b"GET /health/live HTTP/1.1\r\nHost: localhost\r\nX-Slow: "
HALF_BODY = b"POST /x HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\nabc"
WEBSOCKET = (
    b"GET /x HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
)


class Guest:
    """A raw connection."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    async def leave(self) -> None:
        self.writer.close()
        with contextlib.suppress(OSError):  # the server was first
            await self.writer.wait_closed()

    async def is_told_or_cut(self, status: int) -> bool:
        """Whether the server closes with this response only; a reset may overtake it."""
        heard = await self.heard_until_closed()
        return heard.startswith(f"HTTP/1.1 {status}".encode()) or heard == b""

    async def heard_until_closed(self) -> bytes:
        """All that comes until the server closes; it must."""
        try:
            return await asyncio.wait_for(self.reader.read(), SOON_S)
        except ConnectionResetError:
            return b""

    async def status(self) -> int:
        """Status of the next answer; its head is read."""
        head = await asyncio.wait_for(self.reader.readuntil(b"\r\n\r\n"), SOON_S)
        return int(head.split()[1])


Knock = Callable[..., Awaitable[Guest]]
"""Opens a connection to a port and sends the first bytes."""


@pytest.fixture
async def knock() -> AsyncIterator[Knock]:
    guests: list[Guest] = []

    async def at(port: int, first: bytes = b"") -> Guest:
        guest = Guest(*await asyncio.open_connection("127.0.0.1", port))
        guests.append(guest)
        guest.writer.write(first)
        return guest

    yield at
    for guest in guests:
        await guest.leave()


async def answer(send: Send, body: bytes) -> None:
    headers = [(b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": body})


async def counting(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers how many bytes the body had; a websocket is accepted and listened to."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        while (message := await receive())["type"] != "websocket.disconnect":
            if message["type"] == "websocket.receive":
                await send({"type": "websocket.send", "text": "heard"})
        return
    total, more = 0, True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        total += len(message["body"])
        more = message["more_body"]
    await answer(send, str(total).encode())


@pytest.fixture
async def impatient() -> AsyncIterator[int]:
    """A server that waits a fifth of a second where the real one waits most of a minute."""
    async with serve(counting, head_s=WINDOW_S, body_s=WINDOW_S, body_bytes=100) as port:
        yield port


async def test_three_hundred_half_requests_are_closed_while_others_are_served(
    knock: Knock, impatient: int
) -> None:
    guests = [await knock(impatient, HALF_HEAD) for _ in range(300)]
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{impatient}", trust_env=False) as client:
        assert (await client.post("/", content=b"12345")).text == "5"
    heard = await asyncio.gather(*(g.heard_until_closed() for g in guests))
    assert {h.split(b"\r\n")[0] for h in heard} == {b"HTTP/1.1 408 Request Timeout"}


async def test_a_head_that_drips_is_closed_although_something_always_comes(
    knock: Knock, impatient: int
) -> None:
    guest = await knock(impatient, HALF_HEAD)

    async def drip() -> None:
        while True:
            guest.writer.write(b"x")
            await guest.writer.drain()
            await asyncio.sleep(WINDOW_S / 10)

    dripping = asyncio.create_task(drip())
    assert await guest.is_told_or_cut(408)
    dripping.cancel()
    await asyncio.gather(dripping, return_exceptions=True)


async def test_a_half_second_request_on_a_kept_connection_is_closed(knock: Knock, impatient: int) -> None:
    guest = await knock(impatient, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert await guest.status() == 200
    assert await guest.reader.readexactly(1) == b"0"
    guest.writer.write(HALF_HEAD)
    assert (await guest.heard_until_closed()).startswith(b"HTTP/1.1 408")


async def test_a_connection_that_says_nothing_is_closed_without_a_word(knock: Knock, impatient: int) -> None:
    assert await (await knock(impatient)).heard_until_closed() == b""


@pytest.mark.parametrize("drops", [b"", b"x"])
async def test_a_body_that_stops_or_only_drips_is_closed(knock: Knock, impatient: int, drops: bytes) -> None:
    guest = await knock(impatient, HALF_BODY)

    async def drip() -> None:
        while True:
            guest.writer.write(drops)
            await guest.writer.drain()
            await asyncio.sleep(WINDOW_S / 10)

    dripping = asyncio.create_task(drip())
    assert await guest.is_told_or_cut(408)
    dripping.cancel()
    await asyncio.gather(dripping, return_exceptions=True)


@pytest.mark.slow
async def test_a_slow_upload_that_goes_on_is_kept_whole(tmp_path: Path) -> None:
    chunk, chunks, window_s = b"a" * 100, 10, 1.0  # longer: a busy machine stands still for a moment

    async def slowly() -> AsyncIterator[bytes]:
        for _ in range(chunks):
            yield chunk
            await asyncio.sleep(window_s / 4)

    async with (
        open_clinic(tmp_path) as clinic,
        serve(clinic.app, clinic.settings, body_s=window_s, body_bytes=len(chunk)) as port,
        signed_in(clinic, port) as client,
    ):
        patient = (await client.post("/api/v1/patients", json={"code": "P-1"})).raise_for_status().json()
        response = await client.post(f"/api/v1/patients/{patient['id']}/sessions", json={"title": "Walk"})
        path = f"/api/v1/sessions/{response.raise_for_status().json()['id']}/files/walk.txt"
        length = {"Content-Length": str(len(chunk) * chunks)}
        stored = await client.put(path, content=slowly(), headers=length)
        assert stored.raise_for_status().json()["size"] == len(chunk) * chunks


async def test_a_body_that_we_are_slow_to_read_is_not_the_senders_fault() -> None:
    may_read, is_waiting = asyncio.Event(), asyncio.Event()

    async def late(scope: Scope, receive: Receive, send: Send) -> None:
        is_waiting.set()
        await may_read.wait()
        await counting(scope, receive, send)

    size = 1_000_000
    async with (
        serve(late, body_s=WINDOW_S, body_bytes=100) as port,
        httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", trust_env=False, timeout=SOON_S) as client,
    ):
        sent = asyncio.create_task(client.post("/", content=b"a" * size))
        await is_waiting.wait()
        await asyncio.sleep(3 * WINDOW_S)
        may_read.set()
        assert (await sent).text == str(size)


async def large(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers more than all buffers hold."""
    await answer(send, bytes(LARGE))


@pytest.mark.slow
async def test_who_never_reads_the_answer_does_not_keep_the_connection(knock: Knock) -> None:
    async with serving(large, unread_s=WINDOW_S) as (port, server):
        for _ in range(5):
            guest = await knock(port, REQUEST)
            guest.writer.transport.pause_reading()  # type: ignore[attr-defined]
        async with asyncio.timeout(SOON_S):
            while not server.server_state.total_requests or server.server_state.connections:
                await asyncio.sleep(WINDOW_S / 10)


async def test_who_reads_a_large_answer_slowly_gets_all_of_it(knock: Knock) -> None:
    async with serving(large, unread_s=WINDOW_S) as (port, _):
        guest = await knock(port, REQUEST)
        assert await guest.status() == 200
        left, began = LARGE, asyncio.get_running_loop().time()
        while left:
            left -= len(await guest.reader.readexactly(min(left, LARGE // 20)))
            await asyncio.sleep(WINDOW_S / 5)
        assert asyncio.get_running_loop().time() - began > 2 * WINDOW_S


@pytest.mark.parametrize(
    ("begin", "more"),
    [(b"POST", b""), (b"GET", b"Content-Length: 9\r\n"), (b"GET", b"X: 1\r\n" * 500)],
    ids=["post", "body", "headers"],
)
async def test_what_is_no_websocket_handshake_is_refused_at_once(
    knock: Knock, impatient: int, begin: bytes, more: bytes
) -> None:
    guest = await knock(impatient, WEBSOCKET.replace(b"GET", begin)[:-2] + more + b"\r\n")
    assert (await guest.heard_until_closed()).startswith(b"HTTP/1.1 400")


async def test_who_leaves_in_the_middle_of_signing_in_is_no_error(tmp_path: Path) -> None:
    text: list[Message] = []

    async def receive() -> Message:
        return {"type": "http.disconnect"}

    async def send(message: Message) -> None:
        text.append(message)

    headers = [(b"host", b"localhost"), (b"content-length", b"9"), (b"content-type", b"application/json")]
    scope = {"type": "http", "method": "POST", "path": "/api/v1/sign-in", "query_string": b""}
    async with open_clinic(tmp_path) as clinic:
        await clinic.app({**scope, "headers": headers}, receive, send)
    assert text[0]["status"] == 400


async def test_streams_and_websockets_may_last(knock: Knock, impatient: int) -> None:
    """Longer than the head and the body of a request may take."""
    websocket = await knock(impatient, WEBSOCKET)
    assert await websocket.status() == 101
    second = asyncio.Event()

    async def streaming(scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"first", "more_body": True})
        await second.wait()
        await send({"type": "http.response.body", "body": b"last"})

    async with (
        serve(streaming, head_s=WINDOW_S, body_s=WINDOW_S, body_bytes=100) as port,
        httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", trust_env=False) as client,
        client.stream("GET", "/") as stream,
    ):
        parts = stream.aiter_raw()
        assert await anext(parts) == b"first"
        await asyncio.sleep(3 * WINDOW_S)
        second.set()
        assert await anext(parts) == b"last"
    websocket.writer.write(b"\x81\x80\x00\x00\x00\x00")  # an empty text
    assert await asyncio.wait_for(websocket.reader.readexactly(2), SOON_S) == b"\x81\x05"


async def test_beyond_the_limit_guests_are_refused_and_later_served(knock: Knock) -> None:
    async with serve(counting, most=3) as port:
        retained = [await knock(port, HALF_HEAD) for _ in range(3)]
        late = await knock(port)
        assert b"too many connections" in await late.heard_until_closed()
        for guest in retained:
            guest.writer.write(b"\r\n\r\n")
            assert await guest.status() == 200
            await guest.leave()
        async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", trust_env=False) as client:
            assert (await client.post("/", content=b"12")).text == "2"


async def test_a_websocket_message_above_the_protocols_limit_is_refused_by_its_head(
    knock: Knock, impatient: int
) -> None:
    guest = await knock(impatient, WEBSOCKET)
    assert await guest.status() == 101
    head = b"\x82\xff" + (MOST_MESSAGE_BYTES + 1).to_bytes(8, "big") + bytes(4)
    guest.writer.write(head)
    text = await guest.heard_until_closed()
    assert int.from_bytes(text[2:4], "big") == 1009


def signed_in(clinic: Clinic, port: int) -> httpx.AsyncClient:
    return httpx.AsyncClient(
        base_url=f"http://127.0.0.1:{port}",
        headers={"Cookie": f"sid={clinic.token('clinician')}"},
        trust_env=False,
    )
