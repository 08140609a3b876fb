"""Pages about several visits of a patient: trends, two sessions side by side, the programme."""

from __future__ import annotations

import datetime as dt
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.responses import Response

from core.frames import Protocol
from server import visit_views
from server.api.schemas import HexId
from server.auth.access import require
from server.auth.identity import Identity
from server.auth.roles import Action
from server.context import Blobs, Db, Id
from server.services import comparisons, histories, patients, programmes, sessions
from server.services.course import SIX_WEEKS
from server.shell import opened, page
from server.storage.tables import now

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
Reader = Annotated[Identity, require(Action.READ_RESULT)]
Shown = Annotated[
    list[Annotated[str, Query(max_length=64)]], Query(alias="show", max_length=100, default_factory=list)
]

Ticked = Annotated[
    list[Annotated[str, Query(pattern=r"^[0-9a-f]{32}$")]], Query(max_length=100, default_factory=list)
]


@router.get("/patients/{pid}/trends")
def trends(
    request: Request,
    db: Db,
    blobs: Blobs,
    pid: Id,
    who: Reader,
    show: Shown,
    protocol: Protocol | None = None,
    like: HexId | None = None,
) -> Response:
    """Figures over the visits of a patient."""
    with db.read() as c:
        patient = patients.get(c, pid)
        done, plans = histories.read(c, patient)
    history = histories.history(blobs, patient, done, plans, protocol, like)
    opened(request, who, "patient", pid)
    view = visit_views.trends_view(history, show)
    return page(request, db, who, "trends.html", "patients", patient=patient, trends=view)


@router.get("/patients/{pid}/compare")
def choose(db: Db, pid: Id, who: Reader, visit: Ticked) -> Response:
    """Go on to the comparison of the two visits that were ticked, or back when they are not two."""
    with db.read() as c:
        patients.get(c, pid)
    to = f"/sessions/{visit[0]}/compare/{visit[1]}" if len(set(visit)) == 2 else f"/patients/{pid}"
    return RedirectResponse(to, status_code=303)


@router.get("/sessions/{sid}/compare/{other}")
def compare(request: Request, db: Db, blobs: Blobs, sid: Id, other: Id, who: Reader) -> Response:
    """Two sessions: curves over one another, every figure before and after, in words."""
    with db.read() as c:
        found = comparisons.pair(c, sid, other)
    opened(request, who, "session", found.before.session.id)
    opened(request, who, "session", found.after.session.id)
    view = visit_views.comparison_view(blobs, found)
    return page(request, db, who, "compare.html", "patients", patient=found.patient, pair=found, compare=view)


@router.get("/patients/{pid}/programme")
def programme(
    request: Request, db: Db, pid: Id, who: Annotated[Identity, require(Action.READ_SESSION)]
) -> Response:
    """The newest programme of a patient: every planned visit, and which session it was."""
    today = now().date()
    with db.read() as c:
        patient = patients.get(c, pid)
        plans = programmes.of_patient(c, pid)
        linked = {v.session_id for plan in plans for v in plan.visits}
        free = [s for s in sessions.of_patient(c, pid) if s.id not in linked]
    opened(request, who, "patient", pid)
    return page(
        request, db, who, "programme.html", "patients",
        patient=patient,
        programme=visit_views.programme_view(plans[0], today) if plans else None,
        course=SIX_WEEKS,
        free=free,
        monday=today + dt.timedelta(days=-today.weekday() % 7),
    )  # fmt: skip
