"""Requests forwarded unchanged to the responsible server, with its response."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from starlette.types import Receive, Scope, Send

from sagittal.server.nodes import forwarding
from sagittal.server.nodes.forwarding import Forwarding, UnreachableError, open_line
from sagittal.server.nodes.passage import ASKED_BY, HEADER
from sagittal.server.nodes.pins import Owner
from sagittal.server.nodes.registry import WebNode
from sagittal.server.storage.schema.tables import now

pytestmark = pytest.mark.anyio

PINNED = "/api/v1/sessions/" + "1" * 32 + "/live/close"
ANYBODYS = "/api/v1/sessions/" + "1" * 32


class Nodes:
    """What of this server's list of the others is used."""

    def __init__(self) -> None:
        self.suspected: list[WebNode] = []

    def suspect(self, node: WebNode) -> None:
        self.suspected.append(node)

    def write_line(self, node: WebNode, scope: Scope) -> bytes:
        return f"line for {node.name}".encode()


def node_at(port: int, name: str = "b") -> WebNode:
    return WebNode(name, f"http://127.0.0.1:{port}", "", 1, now(), now())


async def here(scope: Scope, receive: Receive, send: Send) -> None:
    """This server's own answer."""
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"here"})


@asynccontextmanager
async def other(answer: bytes) -> AsyncIterator[tuple[int, list[bytes]]]:
    """Second server: its port and received requests."""
    requested_chunks: list[bytes] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = await reader.readuntil(b"\r\n\r\n")
        length = next(int(x[15:]) for x in head.lower().split(b"\r\n") if x.startswith(b"content-length:"))
        requested_chunks.append(head + await reader.readexactly(length))
        writer.write(answer)
        await writer.drain()
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    async with server:
        yield server.sockets[0].getsockname()[1], requested_chunks


def unused_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture
def owners(monkeypatch: pytest.MonkeyPatch) -> list[Owner | None]:
    """Whom the database names, one question after another."""
    named: list[Owner | None] = []
    monkeypatch.setattr(forwarding, "find_owner", lambda *_: named.pop(0))
    return named


async def ask(
    nodes: Nodes, path: str = PINNED, asked_by: str | None = None, **request: Any
) -> httpx.Response:
    app = SimpleNamespace(state=SimpleNamespace(nodes=nodes, db=None))

    async def whole(scope: Scope, receive: Receive, send: Send) -> None:
        scope = {**scope, "app": app} | ({ASKED_BY: asked_by} if asked_by else {})
        await Forwarding(here)(scope, receive, send)

    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(whole), base_url="http://gait.example"
    ) as client:
        return await client.request("POST", path, **request)


async def test_what_is_passed_on_is_what_came_with_the_line_and_without_what_is_of_one_connection(
    owners: list[Owner | None],
) -> None:
    answer = (
        b"HTTP/1.1 418 x\r\nConnection: close\r\nX-Own: 1\r\nSet-Cookie: a=b\r\nContent-Length: 2\r\n\r\nno"
    )
    async with other(answer) as (port, requests):
        owners.append(Owner("b", node_at(port), must=True))
        sent = {
            "cookie": "sid=1",
            "x-forwarded-for": "6.6.6.6",
            HEADER.decode(): "forged",
            "accept-encoding": "gzip",
        }
        got = await ask(Nodes(), f"{PINNED}?a=%20b", content=b"body", headers=sent)
    head, _, body = requests[0].partition(b"\r\n\r\n")
    first, *lines = head.split(b"\r\n")
    headers = {name.lower(): value for name, value in (line.split(b": ", 1) for line in lines)}
    assert first == f"POST {PINNED}?a=%20b HTTP/1.1".encode()
    assert (body, headers[b"content-length"], headers[b"connection"]) == (b"body", b"4", b"close")
    assert (headers[b"host"], headers[b"cookie"]) == (b"gait.example", b"sid=1")
    assert headers[HEADER] == b"line for b"
    assert not headers.keys() & {b"x-forwarded-for", b"accept-encoding"}
    assert head.lower().count(HEADER) == 1
    assert (got.status_code, got.text, got.headers["x-own"], got.headers["set-cookie"]) == (
        418,
        "no",
        "1",
        "a=b",
    )
    assert "connection" not in got.headers


@pytest.mark.parametrize(("path", "asked_by"), [(ANYBODYS, None), ("/patients", None), (PINNED, "b")])
async def test_what_any_may_answer_and_what_was_passed_on_once_is_answered_here(
    owners: list[Owner | None], path: str, asked_by: str | None
) -> None:
    assert (await ask(Nodes(), path, asked_by)).text == "here"


async def test_what_is_ours_or_of_one_that_is_away_is_answered_here(owners: list[Owner | None]) -> None:
    owners += [None, Owner("b", None, must=True)]
    assert (await ask(Nodes())).text == "here"
    assert (await ask(Nodes())).text == "here"
    assert owners == []


async def test_a_server_that_is_not_reached_is_suspected_and_the_question_asked_anew(
    owners: list[Owner | None],
) -> None:
    nodes, offset = Nodes(), node_at(unused_port())
    async with other(b"HTTP/1.1 200 x\r\nContent-Length: 5\r\n\r\nthere") as (port, requests):
        owners += [Owner("b", offset, must=False), Owner("c", node_at(port, "c"), must=False)]
        got = await ask(nodes, content=b"kept")
    assert (got.text, nodes.suspected) == ("there", [offset])
    assert requests[0].endswith(b"\r\n\r\nkept")


async def test_an_answer_that_never_came_is_not_asked_for_twice(owners: list[Owner | None]) -> None:
    nodes = Nodes()
    async with other(b"") as (port, requests):
        owners.append(Owner("b", node_at(port), must=True))
        got = await ask(nodes, content=b"once")
    assert (got.status_code, got.json()["code"], got.headers["retry-after"]) == (503, "node_lost", "5")
    assert (len(requests), nodes.suspected) == (1, [])


async def test_a_line_to_nobody_is_unreachable() -> None:
    ws: Any = SimpleNamespace(
        scope={"headers": [(b"host", b"gait.example")], "path": "/", "query_string": b""},
        headers={"host": "gait.example"},
    )
    with pytest.raises(UnreachableError):
        async with open_line(node_at(unused_port()), ws, b"line"):
            pass
