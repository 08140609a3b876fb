"""Form for a new visit."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.core.subject.condition import USUAL
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, programmes
from sagittal.server.context import Db, Id
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.pages.words import PROTOCOLS, TEST_PROTOCOLS
from sagittal.server.storage.schema.tables import now

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/patients/{pid}/sessions/new")
def show_new_session(
    request: Request, db: Db, pid: Id, user: Annotated[Identity, require(Action.CREATE_SESSION)]
) -> Response:
    """Form with protocol, date, height and walking condition of a new visit."""
    today = now().date()
    with db.read() as c:
        patient = patients.get(c, pid)
        plans = programmes.of_patient(c, pid)
    record_opening(request, user, "patient", pid)
    open_visits = [v for plan in plans[:1] for v in plan.visits if v.session_id is None]
    return render_page(
        request, db, user, "session-new.html", "patients",
        patient=patient, protocols=(*PROTOCOLS, *TEST_PROTOCOLS),
        today=today.isoformat(), open_visits=open_visits,
        near=plans[0].near(today) if plans else None, usual=USUAL,
    )  # fmt: skip
