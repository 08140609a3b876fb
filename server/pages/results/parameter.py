"""Page of one parameter: definition, strides, and links to their times."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db, Id, Reviewed
from sagittal.server.pages.results.session_context import read_measured_context
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.results import analyses, edit_log, reports

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/sessions/{sid}/parameters/{name}")
def show_parameter(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    sid: Id,
    name: Annotated[str, Path(pattern=r"^[a-z0-9_]{1,64}$")],
    user: Annotated[Identity, require(Action.READ_RESULT)],
) -> Response:
    """One parameter of a session with all its strides."""
    with db.read() as c:
        context = read_measured_context(c, sid)
        record = analyses.get_shown(c, sid)
        edits = edit_log.edits_of(c, record.id)
    number = reports.behind_number(
        reviewed, record, edits, context["patient"], context["session"], name, context["controls"]
    )
    record_opening(request, user, "session", sid)
    return render_page(request, db, user, "parameter.html", "patients", number=number, **context)
