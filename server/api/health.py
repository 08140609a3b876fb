"""Whether the process lives, and whether it can do its work."""

from __future__ import annotations

import shutil

from fastapi import APIRouter, Response
from sqlalchemy.exc import SQLAlchemyError

from server import schemas
from server.api.context import Config, Db
from server.api.documents import PUBLIC
from server.auth.access import require
from server.auth.roles import Action
from server.storage.migrate import MigrationError, require_current

router = APIRouter(prefix="/health", tags=["health"], dependencies=[])
_DOOR = [require(Action.CHECK_HEALTH)]


@router.get("/live", dependencies=_DOOR, response_model=schemas.Health, openapi_extra=PUBLIC)
def live() -> schemas.Health:
    """Answer, which is all that is asked."""
    return schemas.Health(status="ok")


@router.get(
    "/ready",
    dependencies=_DOOR,
    response_model=schemas.Health,
    responses={503: {"model": schemas.Health, "description": "A part does not work; `checks` says which"}},
    openapi_extra=PUBLIC,
)
def ready(settings: Config, db: Db, response: Response) -> schemas.Health:
    """Check that the database can be written, its schema is ours, and the disk has room."""
    checks = {"database": "ok", "schema": "ok", "disk": "ok"}
    try:
        # BEGIN IMMEDIATE takes the write lock and rolls back: the real thing without a row
        with db.write() as c:
            c.rollback()
    except SQLAlchemyError:
        checks["database"] = "The database cannot be written."
    try:
        require_current(settings.database)
    except MigrationError as error:
        checks["schema"] = str(error)
    if shutil.disk_usage(settings.data_dir).free < settings.min_free_bytes:
        checks["disk"] = f"Less than {settings.min_free_bytes} bytes are free; uploads are refused."
    healthy = all(state == "ok" for state in checks.values())
    response.status_code = 200 if healthy else 503
    return schemas.Health(status="ok" if healthy else "failing", checks=checks)
