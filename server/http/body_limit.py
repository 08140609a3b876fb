"""Limits the body of every request other than file uploads before it is read into memory."""

from __future__ import annotations

import re
from collections.abc import MutableMapping
from typing import Any

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from sagittal.core.message import Message
from sagittal.server.http.problems import Problem, send_problem

MAX_BODY_BYTES = 1_000_000
"""A manifest of eight sensors has some 4 kB."""
_UPLOAD = re.compile(
    r"(PUT|POST) /api/v1/sessions/[^/]+/(files|references|video)(/|$)|PATCH /api/v1/sessions/[^/]+/uploads/"
)


class BodyLimit:
    """ASGI middleware; uploads have their own limits (settings.max_file_bytes)."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request, or reject its body with 413."""
        if scope["type"] != "http" or _UPLOAD.match(f"{scope['method']} {scope['path']}"):
            await self.app(scope, receive, send)
            return
        problem = Problem(
            413,
            "too_large",
            Message(
                "A request other than a file has at most {MAX_BODY_BYTES} bytes. Send less.",
                MAX_BODY_BYTES=MAX_BODY_BYTES,
            ),
        )
        declared = Headers(scope=scope).get("content-length", "0")
        if not declared.isdecimal() or int(declared) > MAX_BODY_BYTES:
            await send_problem(problem, scope, receive, send)
            return
        total = 0

        async def counted() -> MutableMapping[str, Any]:
            nonlocal total
            message = await receive()
            total += len(message.get("body", b""))
            if total > MAX_BODY_BYTES:
                raise problem
            return message

        await self.app(scope, counted, send)
