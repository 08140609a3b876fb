"""Trusts forwarded client addresses only from the proxies configured by the operator."""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from typing import Final

from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from sagittal.server.web_server.listener import SeldomLog

FORWARDED_FOR: Final = b"x-forwarded-for"


class TrustedProxies:
    """ASGI middleware that replaces the proxy's address and scheme by the client's.

    Parameters
    ----------
    proxies : addresses and networks whose X-Forwarded-For and X-Forwarded-Proto are trusted. In a chain of
        proxies, the last address that is not one of them is the client.
    """

    def __init__(self, app: ASGIApp, proxies: Sequence[str]) -> None:
        self._app = ProxyHeadersMiddleware(app, list(proxies))  # type: ignore[arg-type]
        self._networks = [ipaddress.ip_network(p) for p in proxies]
        self._log = SeldomLog()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection."""
        if scope["type"] in {"http", "websocket"} and any(k == FORWARDED_FOR for k, _ in scope["headers"]):
            sender = scope["client"][0] if scope.get("client") else ""
            if not self._trusts(sender):
                self._log.warn(
                    f"X-Forwarded-For from {sender} is ignored: its users count as one. If it is your proxy, "
                    "add it to SAGITTAL_TRUSTED_PROXIES."
                )
        await self._app(scope, receive, send)  # type: ignore[arg-type]

    def _trusts(self, sender: str) -> bool:
        try:
            address = ipaddress.ip_address(sender)
        except ValueError:
            return False
        return any(address in network for network in self._networks)
