"""Trust in the other web servers of the clinic to forward client addresses."""

from __future__ import annotations

import hmac
import time

from starlette.types import ASGIApp, Receive, Scope, Send

from sagittal.server.http.problems import Problem, send_problem
from sagittal.server.nodes.passage import ASKED_BY, HEADER, LIFE_S, sign
from sagittal.server.nodes.registry import Nodes


class KnownNodes:
    """ASGI middleware that applies the client address forwarded by another web server and rejects
    forgeries.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve or reject one connection."""
        if scope["type"] in {"http", "websocket"}:
            lines = [value for name, value in scope["headers"] if name == HEADER]
            if lines:
                sender = _read(scope["app"].state.nodes, lines, scope)
                if sender is None:
                    detail = "The request claims to come from another server. Send it without that header."
                    await send_problem(Problem(403, "not_a_node", detail), scope, receive, send)
                    return
                asks, client, scheme = sender
                headers = [one for one in scope["headers"] if one[0] != HEADER]
                scope = {**scope, "headers": headers, "client": (client, 0), "scheme": scheme, ASKED_BY: asks}
        await self.app(scope, receive, send)


def _read(nodes: Nodes, lines: list[bytes], scope: Scope) -> tuple[str, str, str] | None:
    """Forwarding server, client address and scheme; None if the header was not signed by one of our
    servers.
    """
    line, _, mac = lines[0].decode("latin-1").rpartition(";")
    parts = line.split(";")
    right = sign(nodes.key, line, scope).encode()
    if len(lines) != 1 or len(parts) != 5 or not hmac.compare_digest(right, mac.encode("latin-1")):
        return None
    asks, receiver, timestamp, client, scheme = parts
    if receiver != nodes.name or abs(time.time() - int(timestamp)) > LIFE_S:
        return None
    return asks, client, scheme
