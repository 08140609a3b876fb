"""The OpenAPI document, including all error responses of every operation as problem+json."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import TypeAdapter

from sagittal.server.api.schemas import ProblemDetails
from sagittal.server.http.problems import MEDIA_TYPE

_WORDS = {
    "400": "The request cannot be read, or its host name is not ours",
    "401": "Not signed in, or wrong name or password",
    "403": "The role does not allow it, or the request came from another site",
    "404": "There is no such thing, or it has been deleted",
    "409": "The present state does not allow it",
    "411": "The length of the body must be declared",
    "413": "Larger than a limit of the settings",
    "422": "A field or the data is not as expected",
    "429": "Too many failed attempts",
    "503": "Busy with other changes or sign-ins, try again in a few seconds; or a stored file cannot be read",
    "507": "The server's disk is full or cannot be written; nothing was saved",
}
_PROBLEM = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/ProblemDetails"}}}


def openapi(app: FastAPI) -> dict[str, Any]:
    """Return the cached OpenAPI document of the application."""
    if app.openapi_schema is None:
        app.openapi_schema = _complete(
            get_openapi(
                title=app.title, version=app.version, summary=app.summary, routes=app.routes, servers=None
            )
        )
    return app.openapi_schema


def refusals(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Declare error responses of an operation in addition to the common ones."""
    return {status: {"description": _WORDS[str(status)]} for status in statuses}


def _complete(document: dict[str, Any]) -> dict[str, Any]:
    components = document.setdefault("components", {})
    schemas = components.setdefault("schemas", {})
    whole = TypeAdapter(ProblemDetails).json_schema(ref_template="#/components/schemas/{model}")
    schemas.update(whole.pop("$defs", {}))
    schemas["ProblemDetails"] = whole
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    components["securitySchemes"] = {
        "session": {"type": "apiKey", "in": "cookie", "name": "sid"},
        "token": {"type": "http", "scheme": "bearer"},
    }
    document["security"] = [{"session": []}, {"token": []}]
    for path, item in document["paths"].items():
        for method, operation in item.items():
            responses = operation["responses"]
            common = {"400", "422", "503", "507"} if path.startswith("/api/") else {"400"}
            if operation.get("security") != []:
                common |= {"401", "403"}
            if method not in {"get", "head"}:
                common |= {"403", "413"}
            if "{" in path:
                common.add("404")
            for status in common:
                responses.setdefault(status, {"description": _WORDS[status]})
            for status, response in responses.items():
                if status in _WORDS:
                    response["description"] = _WORDS[status]
                    response["content"] = _PROBLEM
    return document


PUBLIC: dict[str, Any] = {"security": []}
"""`openapi_extra` of an operation that needs no sign-in."""
