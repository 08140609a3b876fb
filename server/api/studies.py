"""The tables of a study over many visits."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter
from starlette.responses import Response

from server.api.documents import refusals
from server.api.downloads import BINARY, attachment
from server.auth.access import require
from server.auth.identity import Identity
from server.auth.roles import Action
from server.context import Db, OpenTrail, Reviewed, StudyVisits
from server.export.zipping import zip_files
from server.services import studies

router = APIRouter(tags=["exports"])
_ANSWERS: dict[int | str, dict[str, Any]] = refusals(409) | {
    200: {"description": "The tables", "content": {"application/zip": {"schema": BINARY}}}
}


@router.get("/study.zip", response_class=Response, responses=_ANSWERS)
def make_study(
    db: Db,
    reviewed: Reviewed,
    trail: OpenTrail,
    choice: StudyVisits,
    who: Annotated[Identity, require(Action.EXPORT_STUDY)],
) -> Response:
    """All strides and all takes of the chosen visits as they count, as CSV and Parquet, by pseudonyms."""
    tables, visits = studies.make_study(db, reviewed, who, choice)
    for visit in visits:
        trail.record_opened(who, "study.exported", "session", visit, {"visits": len(visits)})
    return attachment(zip_files(tables.files), "study.zip")
