"""Assembles the web server: uvicorn with our connections, limits and proxies."""

from __future__ import annotations

import uvicorn
from starlette.types import ASGIApp

from sagittal.server.live.protocol import MOST_MESSAGE_BYTES
from sagittal.server.settings import Settings
from sagittal.server.web_server.connection import ConnectionLimits, make_connection_class
from sagittal.server.web_server.proxies import TrustedProxies

GRACE_S = 4
"""Time limit for open requests (event streams, views) after SIGTERM; in total it ends within 10 s."""


def build_server(app: ASGIApp, settings: Settings, limits: ConnectionLimits) -> uvicorn.Server:
    """Return a server for an application; `run` it on sockets of `open_listener`."""
    return uvicorn.Server(
        uvicorn.Config(
            TrustedProxies(app, settings.proxies) if settings.proxies else app,
            log_level="warning",
            access_log=False,
            # listener and connections are designed for these two
            loop="asyncio",
            http=make_connection_class(limits),
            proxy_headers=False,
            server_header=False,
            timeout_graceful_shutdown=GRACE_S,
            ws_per_message_deflate=False,
            # the largest message of any socket is a tablet's
            ws_max_size=MOST_MESSAGE_BYTES,
        )
    )
