"""Study tables over many visits."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter
from starlette.responses import Response

from sagittal.server.api.documents import refusals
from sagittal.server.api.downloads.downloads import BINARY, attachment
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Config, Db, OpenTrail, StudyVisits
from sagittal.server.downloads import study_maker

router = APIRouter(tags=["exports"])
_ANSWERS: dict[int | str, dict[str, Any]] = refusals(409, 503) | {
    200: {"description": "The tables", "content": {"application/zip": {"schema": BINARY}}}
}


@router.get("/study.zip", response_class=Response, responses=_ANSWERS)
def make_study(
    db: Db,
    settings: Config,
    trail: OpenTrail,
    choice: StudyVisits,
    user: Annotated[Identity, require(Action.EXPORT_STUDY)],
) -> Response:
    """Tables of all strides and trials of the selected visits, as CSV and Parquet, pseudonymized."""
    content, visits = study_maker.fetch_study(db, settings, user, choice)
    for visit in visits:
        trail.record_opened(user, "study.exported", "session", visit, {"visits": len(visits)})
    return attachment(content, "study.zip")
