"""Rejects cross-site requests by the headers that browsers set; forms need no tokens.

Uses Sec-Fetch-Site if present (W3C Fetch Metadata), otherwise compares Origin with Host, the rule of Go's
net/http.CrossOriginProtection. A client that sends neither header is not a browser and carries no cookie that
another site could exploit. Browsers let any page open a websocket, so the rule also applies to the opening
handshake.
"""

from __future__ import annotations

from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from sagittal.server.http.problems import Problem, send_problem

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})


def is_cross_site(headers: Headers) -> bool:
    """Whether a browser sent this request on behalf of another site."""
    origin = headers.get("origin")
    site = headers.get("sec-fetch-site")
    if site is not None and site not in {"same-origin", "none"}:
        return True
    if origin is None:
        return False
    # "null" (sandboxed frames, some redirects) has no netloc and so never equals a host
    return urlsplit(origin).netloc.lower() != headers.get("host", "").lower()


class CrossSiteGuard:
    """ASGI middleware that rejects cross-site changes and cross-site websockets before they are accepted."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve or reject one connection."""

        guarded = scope["type"] == "websocket" or (
            scope["type"] == "http" and scope["method"] not in SAFE_METHODS
        )
        if guarded and is_cross_site(Headers(scope=scope)):
            problem = Problem(
                403,
                "cross_site_request",
                "The request came from another site. Open Sagittal in its own window and try again there.",
            )
            await send_problem(problem, scope, receive, send)
            return
        await self.app(scope, receive, send)
