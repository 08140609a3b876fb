"""Host allow-list: rejects unknown host names, so that DNS rebinding cannot use our origin."""

from __future__ import annotations

from collections.abc import Iterable

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from sagittal.server.http.problems import Problem, send_problem

LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})


def host_name(host: str) -> str:
    """Return the lower-case name of a Host header, without port and brackets."""
    host = host.strip().lower()
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0].removesuffix(".")


class HostGuard:
    """ASGI middleware that accepts only loopback and configured host names, for HTTP and websockets."""

    def __init__(self, app: ASGIApp, allowed: Iterable[str] = ()) -> None:
        self.app = app
        self.allowed = LOOPBACK | {host_name(name) for name in allowed}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve or reject one connection."""

        if scope["type"] in {"http", "websocket"}:
            hosts = Headers(scope=scope).getlist("host")
            if len(hosts) != 1 or host_name(hosts[0]) not in self.allowed:
                problem = Problem(
                    400,
                    "host_not_allowed",
                    "This server answers only to its own names. Use one of the configured host names, "
                    "or add this one to the allowed hosts in the server's settings.",
                )
                await send_problem(problem, scope, receive, send)
                return
        await self.app(scope, receive, send)
