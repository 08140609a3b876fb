"""Request bodies parsed with the strict rules for untrusted JSON (core/formats/json_tree.py)."""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute

from sagittal.core.formats.json_tree import read_json


class StrictJsonRequest(Request):
    """A request whose JSON must not have duplicate keys, NaN, lone surrogates or deep nesting."""

    async def json(self) -> Any:
        """Return the body as Python values; raises JSONDecodeError, which FastAPI converts to 422."""
        body = await self.body()
        try:
            return read_json(body)
        except ValueError as error:
            raise json.JSONDecodeError(str(error), "", 0) from None


class StrictJsonRoute(APIRoute):
    """Route that parses its body strictly; use `APIRouter(route_class=StrictJsonRoute)`."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the request handler."""
        handler = super().get_route_handler()

        async def handle(request: Request) -> Response:
            return await handler(StrictJsonRequest(request.scope, request.receive))

        return handle
