"""Selection of visits for the tables of a study."""

from __future__ import annotations

from typing import Annotated, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.core.user_text import UserText
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db, StudyVisits
from sagittal.server.downloads import studies
from sagittal.server.pages.shell import record_listing, render_page
from sagittal.server.pages.words import PROTOCOL_NAMES

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

TICKED_AT_MOST: Final = 100
"""Up to this number visits can be excluded individually; otherwise only the filters above the list apply."""


@router.get("/study")
def show_study(
    request: Request, db: Db, choice: StudyVisits, user: Annotated[Identity, require(Action.EXPORT_STUDY)]
) -> Response:
    """Visits that match the selection, and download of their tables."""
    with db.read() as c:
        matching_visits = studies.list_visits(c, user, choice)
    selection = {
        "q": UserText(choice.search),
        "protocol": choice.protocol or "",
        "since": choice.since.isoformat() if choice.since else "",
        "until": choice.until.isoformat() if choice.until else "",
    }
    record_listing(request, user, "patient")
    return render_page(
        request, db, user, "study.html", "patients",
        visits=matching_visits[: studies.MOST_VISITS],
        count=len(matching_visits),
        people=len({s.patient_id for s in matching_visits}),
        most=studies.MOST_VISITS,
        ticked=len(matching_visits) <= TICKED_AT_MOST,
        asked=selection,
        all=f"/api/v1/study.zip?{urlencode(selection)}",
        protocols=[("", "All"), *PROTOCOL_NAMES.items()],
        names=PROTOCOL_NAMES,
    )  # fmt: skip
