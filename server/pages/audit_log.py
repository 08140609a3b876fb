"""Page of the audit log."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.server import audit
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db
from sagittal.server.pages.audit_words import describe_rows
from sagittal.server.pages.shell import render_page

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

AUDIT_ROWS = 100


@router.get("/audit")
def show_audit_log(
    request: Request,
    db: Db,
    user: Annotated[Identity, require(Action.READ_AUDIT)],
    before: Annotated[int | None, Query(ge=1, le=2**53)] = None,
) -> Response:
    """Access and changes by users, newest first."""
    with db.read() as c:
        rows = audit.list_entries(c, before_seq=before, limit=AUDIT_ROWS)
        sentences = describe_rows(c, rows)
    older = rows[-1].seq if len(rows) == AUDIT_ROWS else None
    return render_page(request, db, user, "audit.html", "audit", rows=sentences, older=older)
