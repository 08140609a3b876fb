"""Forwards a request or websocket to the web server that owns it, and returns the response.

Requests are forwarded unchanged: the receiving server checks the cookie or token itself. A request that has
been forwarded once is answered by the receiving server in any case.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator
from typing import Any, Final
from urllib.parse import urlsplit

import h11
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidStatus, WebSocketException

from sagittal.core.message import Message
from sagittal.server.http.carrying import carry_messages
from sagittal.server.http.problems import Problem, send_problem
from sagittal.server.nodes import passage
from sagittal.server.nodes.pins import find_owner, find_pin
from sagittal.server.nodes.registry import Nodes, WebNode

log = logging.getLogger(__name__)

CONNECT_S: Final = 3.0
"""Time limit for connecting to a server on the same network."""
ANSWER_S: Final = 90.0
"""Time limit for a response; ending a trial may wait for the disk."""
_PIECE: Final = 1 << 16
_HOPS: Final = frozenset(
    b"connection keep-alive proxy-authenticate proxy-authorization proxy-connection te trailer "
    b"transfer-encoding upgrade expect accept-encoding content-length forwarded x-forwarded-for "
    b"x-forwarded-proto x-forwarded-host x-real-ip date server x-sagittal-node".split()
)
"""Hop-by-hop headers, and our own; compression is for the browser's connection."""


class UnreachableError(Exception):
    """The server did not accept the connection; nothing has been sent."""


class Forwarding:
    """Innermost ASGI middleware, so that all checks on a request have been applied."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection here, or forward it to its owner."""
        pin = None
        if scope["type"] in {"http", "websocket"} and passage.ASKED_BY not in scope:
            pin = find_pin(scope)
        if pin is None:
            await self.app(scope, receive, send)
            return
        state = scope["app"].state
        nodes: Nodes = state.nodes
        while (owner := await asyncio.to_thread(find_owner, state.db, nodes, pin)) is not None:
            if owner.node is None:
                break
            try:
                if scope["type"] == "http":
                    await _pass_request(nodes, owner.node, scope, receive, send)
                else:
                    await _pass_line(nodes, owner.node, WebSocket(scope, receive, send))
            except UnreachableError:
                nodes.suspect(owner.node)
                log.warning("the web server '%s' at %s is not reached", owner.name, owner.node.address)
                continue
            return
        await self.app(scope, receive, send)


async def _pass_request(nodes: Nodes, node: WebNode, scope: Scope, receive: Receive, send: Send) -> None:
    url = urlsplit(node.address)
    try:
        async with asyncio.timeout(CONNECT_S):
            reader, writer = await asyncio.open_connection(url.hostname, url.port, ssl=_is_tls(node) or None)
    except (OSError, TimeoutError) as error:
        raise UnreachableError from error
    with contextlib.closing(writer):
        body = await _read_body(receive)
        if body is None:
            return
        headers = [one for one in scope["headers"] if one[0] not in _HOPS]
        headers.append((passage.HEADER, nodes.write_line(node, scope)))
        headers += [(b"connection", b"close"), (b"content-length", str(len(body)).encode())]
        request = h11.Request(method=scope["method"], target=_target(scope), headers=headers)
        try:
            async with asyncio.timeout(ANSWER_S):
                answer = await _ask(reader, writer, request, body)
        except (OSError, TimeoutError, h11.ProtocolError):
            problem = Problem(
                503,
                "node_lost",
                Message(
                    "The web server '{name}' did not respond. Check whether the request was carried "
                    "out before trying again.",
                    name=node.name,
                ),
                headers={"Retry-After": "5"},
            )
            await send_problem(problem, scope, receive, send)
            return
    await answer(scope, receive, send)


async def _pass_line(nodes: Nodes, node: WebNode, ws: WebSocket) -> None:
    line = nodes.write_line(node, ws.scope)
    try:
        async with open_line(node, ws, line) as up:
            await ws.accept(subprotocol=up.subprotocol)
            await carry_messages(ws, up)
    except InvalidStatus as refused:
        answer = refused.response
        forwarded = {
            name: value for name, value in answer.headers.raw_items() if name.lower().encode() not in _HOPS
        }
        denial = Response(answer.body, answer.status_code, forwarded)
        if "websocket.http.response" in ws.scope.get("extensions", {}):
            await ws.send_denial_response(denial)
        else:
            await ws.close(1008)


async def carry_tablet(nodes: Nodes, node: WebNode, ws: WebSocket, first: str | bytes) -> None:
    """Relay an open tablet connection, including its first message, to the server of the trial.

    Raises
    ------
    UnreachableError
        nothing has been sent; the tablet may reconnect.
    """
    line = nodes.write_line(node, ws.scope)
    try:
        async with open_line(node, ws, line) as up:
            await up.send(first)
            await carry_messages(ws, up)
    except InvalidStatus as error:
        raise UnreachableError from error


@contextlib.asynccontextmanager
async def open_line(node: WebNode, ws: WebSocket, line: bytes) -> AsyncIterator[ClientConnection]:
    """Open a websocket to another server on behalf of the client; raises UnreachableError, InvalidStatus."""
    url = urlsplit(node.address)
    own = {b"host", b"user-agent"}
    headers = [
        (name.decode("latin-1"), value.decode("latin-1"))
        for name, value in ws.scope["headers"]
        if name not in _HOPS and name not in own and not name.startswith(b"sec-websocket-")
    ]
    headers.append((passage.HEADER.decode(), line.decode("latin-1")))
    host = ws.headers["host"]
    scheme = "wss" if _is_tls(node) else "ws"
    options: dict[str, Any] = {"server_hostname": url.hostname} if _is_tls(node) else {}
    try:
        up = await connect(
            f"{scheme}://{host}{_target(ws.scope).decode('latin-1')}",
            # the Host as requested by the client, the connection to the other server
            host=url.hostname,
            port=url.port,
            additional_headers=headers,
            user_agent_header=ws.headers.get("user-agent"),
            subprotocols=ws.scope.get("subprotocols") or None,
            open_timeout=CONNECT_S,
            max_size=None,
            compression=None,
            proxy=None,
            **options,
        )
    except InvalidStatus:
        raise
    except (OSError, TimeoutError, WebSocketException) as error:
        raise UnreachableError from error
    async with up:
        yield up


async def _ask(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, request: h11.Request, body: bytes
) -> Response:
    """Send a request and return the complete response."""
    line = h11.Connection(h11.CLIENT)
    for part in (request, h11.Data(data=body), h11.EndOfMessage()):
        writer.write(line.send(part) or b"")
    await writer.drain()
    head: h11.Response | None = None
    content = bytearray()
    while True:
        event = line.next_event()
        if event is h11.NEED_DATA:
            line.receive_data(await reader.read(_PIECE))
        elif isinstance(event, h11.Response):
            head = event
        elif isinstance(event, h11.Data):
            content += event.data
        elif isinstance(event, h11.EndOfMessage) and head is not None:
            answer = Response(bytes(content), head.status_code)
            # the response to HEAD has no body but states its length
            answer.raw_headers = [
                (name, value)
                for name, value in head.headers
                if name not in _HOPS or name == b"content-length"
            ]
            return answer
        elif isinstance(event, h11.ConnectionClosed):
            raise h11.RemoteProtocolError("closed without an answer")


async def _read_body(receive: Receive) -> bytes | None:
    """Read the whole body of limited length (server/http/body_limit.py); None if the client disconnected."""
    body, more = bytearray(), True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            return None
        body += message.get("body", b"")
        more = message.get("more_body", False)
    return bytes(body)


def _target(scope: Scope) -> bytes:
    path: bytes = scope.get("raw_path") or scope["path"].encode()
    query: bytes = scope["query_string"]
    return path + (b"?" + query if query else b"")


def _is_tls(node: WebNode) -> bool:
    return node.address.startswith("https:")
