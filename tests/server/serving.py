"""Application behind a real uvicorn on a loopback port, where an in-memory transport is not enough."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Any

import uvicorn

from sagittal.server.settings import Settings
from sagittal.server.web_server.build import build_server
from sagittal.server.web_server.connection import ConnectionLimits
from sagittal.server.web_server.listener import open_listener


@contextlib.asynccontextmanager
async def serve(app: Any, settings: Settings | None = None, **limits: Any) -> AsyncIterator[int]:
    """Serve on a free port of this event loop, without the lifespan (a clinic has started its own)."""
    async with serving(app, settings, **limits) as (port, _):
        yield port


@contextlib.asynccontextmanager
async def serving(
    app: Any, settings: Settings | None = None, **limits: Any
) -> AsyncIterator[tuple[int, uvicorn.Server]]:
    """Serve, and also return the server."""
    with open_listener("127.0.0.1", 0) as listener:
        server = build_server(app, settings or Settings(), ConnectionLimits(**limits))
        server.config.lifespan = "off"
        server.config.timeout_graceful_shutdown = 2
        server.capture_signals = contextlib.nullcontext  # type: ignore[method-assign, assignment]
        task = asyncio.create_task(server.serve([listener]))
        while not server.started:
            await asyncio.sleep(0.01)
        try:
            yield listener.getsockname()[1], server
        finally:
            server.should_exit = True
            await task
