"""Request ids, durations and machine-readable access log lines.

Neither log lines nor metrics contain query strings, names or bodies, only the route's pattern, the method and
the status.
"""

from __future__ import annotations

import logging
import secrets
import time
from collections.abc import Callable
from typing import Final

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from sagittal.server.log import request_id

log = logging.getLogger(__name__)

NO_ROUTE: Final = "none"
"""Label for addresses without a route."""
_PREFIXES: Final = ("/api/v1", "/static")
"""Prefixes of mounted routes, which a route's own pattern lacks."""


class RequestObserver:
    """ASGI middleware that assigns request ids and calls `observe(method, route pattern, status, seconds)`.

    Parameters
    ----------
    line : whether to write a log line for each request.
    """

    def __init__(
        self, app: ASGIApp, *, line: bool, observe: Callable[[str, str, int, float], None] | None = None
    ) -> None:
        self.app, self._line, self._observe = app, line, observe

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection."""
        if scope["type"] not in {"http", "websocket"}:
            await self.app(scope, receive, send)
            return
        own = secrets.token_hex(8)
        # never reset: the server's log of a failed request is written later in the same task
        request_id.set(own)
        began = time.perf_counter()
        status = 500  # no response was sent

        async def with_id(message: Message) -> None:
            nonlocal status
            if message["type"] in {"http.response.start", "websocket.http.response.start"}:
                status = message["status"]
                MutableHeaders(scope=message)["X-Request-ID"] = own
            await send(message)

        try:
            await self.app(scope, receive, with_id)
        finally:
            if scope["type"] == "http":
                self._tell(scope, status, time.perf_counter() - began)

    def _tell(self, scope: Scope, status: int, took_s: float) -> None:
        pattern = _find_pattern(scope)
        if self._observe is not None:
            self._observe(scope["method"], pattern, status, took_s)
        if self._line:
            fields = {
                "method": scope["method"],
                "route": pattern,
                "status": status,
                "took_s": round(took_s, 4),
            }
            log.info("request", extra=fields)


def _find_pattern(scope: Scope) -> str:
    prefix = next((one for one in _PREFIXES if scope["path"].startswith(f"{one}/")), "")
    own = getattr(scope.get("route"), "path", None)
    if own is None:
        return prefix if prefix == "/static" else NO_ROUTE
    return str(own) if own.startswith(prefix) else f"{prefix}{own}"
