"""Audit trail, for administrators."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from sagittal.server import audit
from sagittal.server.api import schemas
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db
from sagittal.server.errors import NotFound
from sagittal.server.storage.high_water import read_newest

router = APIRouter(prefix="/audit", tags=["audit"])


@router.get("/head", response_model=schemas.AuditHead)
def read_head(db: Db, user: Annotated[Identity, require(Action.READ_AUDIT)]) -> schemas.AuditHead:
    """Number and hash of the newest row, to be stored outside the server (`sagittal check --head FILE`)."""
    with db.read() as c:
        newest = read_newest(c)
    if newest is None:
        raise NotFound("audit row", "1")
    return schemas.AuditHead(newest.seq, newest.hash)


@router.get("", response_model=list[schemas.AuditRow])
def list_audit(
    db: Db,
    user: Annotated[Identity, require(Action.READ_AUDIT)],
    before: Annotated[int | None, Query(ge=1, le=2**53, description="rows older than this number")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> list[schemas.AuditRow]:
    """List audit rows, newest first."""
    with db.read() as c:
        return [
            schemas.make_answer(schemas.AuditRow, row)
            for row in audit.list_entries(c, before_seq=before, limit=limit)
        ]
