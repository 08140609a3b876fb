"""Central conversion of errors to responses: RFC 9457 problem+json, or a page for browsers."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any
from urllib.parse import quote

from fastapi import FastAPI
from fastapi.exceptions import HTTPException, RequestValidationError
from jinja2 import TemplateNotFound
from sqlalchemy.exc import DataError, OperationalError
from starlette.exceptions import HTTPException as AnyHttpException
from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.routing import Match, Mount
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketState

from sagittal.core.errors import SagittalError, title_of_code
from sagittal.core.message import Message
from sagittal.server.http.headers import add_security_headers
from sagittal.server.http.templates import render
from sagittal.server.log import request_id
from sagittal.server.storage.files.blobs import IntegrityError, StoreAway
from sagittal.server.storage.refusal import is_busy, refusal_of

log = logging.getLogger(__name__)
MEDIA_TYPE = "application/problem+json"


METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")


# all other exceptions propagate to the server, which logs them
LOGGED_HERE = (SagittalError, OperationalError)


class Problem(HTTPException):
    """An error response with its HTTP status, a stable code and a sentence with the remedy."""

    def __init__(
        self,
        status: int,
        code: str,
        detail: str,
        *,
        headers: Mapping[str, str] | None = None,
        errors: list[dict[str, str]] | None = None,
    ) -> None:
        # an HTTPException, because FastAPI lets only those through when reading a body fails
        super().__init__(status, detail, dict(headers or {}))
        self.status = status
        self.code = code
        self.errors = errors

    def to_json(self) -> dict[str, Any]:
        """Return the members of RFC 9457 §3.1 plus `code` and, for invalid fields, `errors`."""
        body: dict[str, Any] = {
            "type": f"urn:sagittal:problem:{self.code}",
            "title": title_of_code(self.code),
            "status": self.status,
            "detail": self.detail,
            "code": self.code,
        }
        if self.errors is not None:
            body["errors"] = self.errors
        return body


def as_problem(error: Exception) -> Problem:
    """Convert any exception to a Problem; the cause of an unexpected one is not disclosed."""
    if isinstance(error, Problem):
        return error
    if isinstance(error, StoreAway):
        return Problem(503, error.code, SENTENCES[error.code], headers={"Retry-After": "5"})
    if isinstance(error, SagittalError):
        return Problem(getattr(error, "status", 422), error.code, error.message)
    if isinstance(error, RequestValidationError):
        fields = [
            {"field": ".".join(str(part) for part in item["loc"][1:]), "message": _without_input(item)}
            for item in error.errors()
        ]
        return Problem(
            422,
            "invalid_request",
            Message(
                "The request does not have the expected form: {join}",
                join="; ".join(f"{f['field']}: {f['message']}" for f in fields[:5]),
            ),
            errors=fields,
        )
    if isinstance(error, AnyHttpException):
        code = CODE_OF_STATUS.get(error.status_code, "http_error")
        text = str(error.detail)
        is_bare = text == HTTPStatus(error.status_code).phrase
        return Problem(
            error.status_code, code, SENTENCES.get(code, text) if is_bare else text, headers=error.headers
        )
    refusal = refusal_of(error)
    if refusal is not None:
        return Problem(507, refusal.value, refusal.sentence)
    if is_busy(error):
        return Problem(503, "database_busy", SENTENCES["database_busy"], headers={"Retry-After": "5"})
    if isinstance(error, DataError):  # PostgreSQL is stricter than SQLite
        return Problem(422, "not_storable", SENTENCES["not_storable"])
    return Problem(500, "internal_error", SENTENCES["internal_error"])


def problem_response(problem: Problem, connection: HTTPConnection) -> Response:
    """Respond with JSON, or with a page to a browser's page request (401: the sign-in page)."""
    if _wants_page(connection):
        if problem.status == HTTPStatus.UNAUTHORIZED and connection.scope["method"] == "GET":
            path = connection.url.path + (f"?{connection.url.query}" if connection.url.query else "")
            return RedirectResponse(f"/sign-in?next={quote(path)}", status_code=303)
        try:
            return render(
                Request(connection.scope),
                "error.html",
                {"problem": problem.to_json()},
                status_code=problem.status,
                headers=problem.headers,
            )
        except TemplateNotFound:
            log.warning("error page template is missing; answering with JSON")
    return JSONResponse(problem.to_json(), problem.status, problem.headers, MEDIA_TYPE)


async def send_problem(problem: Problem, scope: Scope, receive: Receive, send: Send) -> None:
    """Reject a request from within a middleware; websockets are rejected before they are accepted
    (HTTP 403).
    """
    if scope["type"] == "websocket":
        await refuse_websocket(WebSocket(scope, receive, send), problem)
    else:
        await problem_response(problem, HTTPConnection(scope))(scope, receive, send)


async def refuse_websocket(websocket: WebSocket, problem: Problem) -> None:
    """Reject with the problem's own status if the server supports it, otherwise by closing (403 in
    uvicorn).
    """
    if websocket.application_state is not WebSocketState.CONNECTING:
        await websocket.close(1008, problem.code)
    elif "websocket.http.response" in websocket.scope.get("extensions", {}):
        body = JSONResponse(problem.to_json(), problem.status, problem.headers, MEDIA_TYPE)
        await websocket.send_denial_response(body)
    else:
        await websocket.close(1008, problem.code)


def install(app: FastAPI) -> None:
    """Register the single handler for all exceptions of endpoints."""

    async def handle(connection: HTTPConnection, error: Exception) -> Response | None:
        problem = as_problem(error)
        if _names_nothing(error) and _wants_page(connection):
            problem = Problem(404, "not_found", SENTENCES["not_found"])  # a truncated URL
        if problem.status == HTTPStatus.METHOD_NOT_ALLOWED:
            problem.headers = {**(problem.headers or {}), **_list_allowed(connection.scope)}
        if problem.status == HTTPStatus.INTERNAL_SERVER_ERROR and isinstance(error, LOGGED_HERE):
            log.error("%s %s", connection.scope["type"], problem.code, exc_info=error)
        if isinstance(error, IntegrityError):  # it must be restored: one log line identifies it
            log.error("%s: %s", problem.code, error.message)
        if problem.status == HTTPStatus.INSUFFICIENT_STORAGE:
            log.warning("%s refused: %s", connection.scope["type"], problem.code)
        if isinstance(connection, WebSocket):
            await refuse_websocket(connection, problem)
            return None
        response = problem_response(problem, connection)
        # Starlette responds with 500 outside all middleware
        add_security_headers(response.headers)
        current_id = request_id.get()
        if current_id is not None:
            response.headers["X-Request-ID"] = current_id
        return response

    async def handle_disk(connection: HTTPConnection, error: Exception) -> Response | None:
        # of another kind: handled by the server, which logs it, and by the general handler
        if refusal_of(error) is None:
            raise error
        return await handle(connection, error)

    all_kinds: tuple[type[Exception], ...] = (
        AnyHttpException,
        SagittalError,
        RequestValidationError,
        OperationalError,
        DataError,
        Exception,
    )
    for kind in all_kinds:
        app.add_exception_handler(kind, handle)  # type: ignore[arg-type]
    for raw in (OSError, sqlite3.OperationalError):
        app.add_exception_handler(raw, handle_disk)  # type: ignore[arg-type]


def _wants_page(connection: HTTPConnection) -> bool:
    if connection.scope["type"] != "http" or "text/html" not in connection.headers.get("accept", ""):
        return False
    # a form of a page without scripts posts to the API and is also a page request of a browser
    is_form = connection.headers.get("content-type", "").startswith("application/x-www-form-urlencoded")
    return is_form or not connection.url.path.startswith(("/api/", "/health/", "/static/"))


def _list_allowed(scope: Scope) -> dict[str, str]:
    """Return the Allow header with the methods of all routes at this path."""
    routes = [one for one in scope["app"].routes if not isinstance(one, Mount)]
    allowed = [
        method
        for method in METHODS
        if any(one.matches({**scope, "method": method})[0] is Match.FULL for one in routes)
    ]
    return {"Allow": ", ".join(allowed)} if allowed else {}


def _names_nothing(error: Exception) -> bool:
    """Whether an id in the path is malformed, so that the resource cannot exist."""
    return isinstance(error, RequestValidationError) and any(e["loc"][0] == "path" for e in error.errors())


def _without_input(item: Mapping[str, Any]) -> str:
    # pydantic's text of a failed validator may quote the value, and the value may be a patient's name
    message = str(item["msg"])
    has_own = item["type"] in {"value_error", "json_invalid"} and item.get("ctx") is not None
    return str(item["ctx"]["error"]) if has_own else message


CODE_OF_STATUS = {
    400: "bad_request",
    401: "not_signed_in",
    403: "forbidden",
    404: "not_found",
    405: "method_not_allowed",
    413: "too_large",
    415: "unsupported_media_type",
    422: "invalid_request",
    429: "too_many_attempts",
    503: "unavailable",
}

SENTENCES = {
    "bad_request": "The request could not be read. Check that its body is valid and complete.",
    "not_signed_in": "You are not signed in, or the session has ended. Sign in and try again.",
    "forbidden": "Your role does not allow this. Ask an administrator if you need it.",
    "not_found": "Nothing exists at this address, or it has been deleted.",
    "method_not_allowed": "This address does not offer that method; see /api/v1/openapi.json.",
    "database_busy": "Another change is taking unusually long. Try again in a few seconds.",
    "not_storable": "A text is too long or has a character that cannot be stored. Change it, then try again.",
    "store_away": "The file storage is unavailable, so nothing was changed. Try again in a minute; if the "
    "problem persists, inform the administrator.",
    "store_refuses": (
        "The file storage denied access to the server. Inform the administrator, then try again."
    ),
    "internal_error": "Something went wrong on the server. The server's log has the details; try again.",
}
