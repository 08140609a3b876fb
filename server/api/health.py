"""Liveness and readiness of the server."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from sagittal.server.api import schemas
from sagittal.server.api.documents import PUBLIC
from sagittal.server.auth.access import require
from sagittal.server.auth.roles import Action
from sagittal.server.context import state_of

router = APIRouter(prefix="/health", tags=["health"], dependencies=[])
_DOOR = [require(Action.CHECK_HEALTH)]


@router.get("/live", dependencies=_DOOR, response_model=schemas.HealthAnswer, openapi_extra=PUBLIC)
def live() -> schemas.HealthAnswer:
    """Respond if the process is alive."""
    return schemas.HealthAnswer(status="ok")


@router.get(
    "/ready",
    dependencies=_DOOR,
    response_model=schemas.HealthAnswer,
    responses={
        503: {"model": schemas.HealthAnswer, "description": "A part does not work; `checks` says which"}
    },
    openapi_extra=PUBLIC,
)
def ready(request: Request, response: Response) -> schemas.HealthAnswer:
    """Check that database and folder are writable, the schema is current, space is left and processes run."""
    checks = dict(state_of(request).readiness.checks())
    healthy = all(state == "ok" for state in checks.values())
    response.status_code = 200 if healthy else 503
    return schemas.HealthAnswer(status="ok" if healthy else "failing", checks=checks)
