"""Comparison of two sessions of a patient, parameter by parameter."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter
from fastapi.responses import JSONResponse
from starlette.responses import Response

from sagittal.server.api.documents import refusals
from sagittal.server.api.downloads.downloads import BINARY, attachment
from sagittal.server.api.results import trend_schemas
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db, Id, OpenTrail, Reviewed
from sagittal.server.report.files.columns import reduce_to_plain
from sagittal.server.report.history.comparison import comparison_csv
from sagittal.server.results import comparisons
from sagittal.server.results.comparisons import SessionPair
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.storage.db import Database
from sagittal.server.trail import AuditTrail

router = APIRouter(prefix="/sessions/{session_id}/compare", tags=["trends"])
Reader = Annotated[Identity, require(Action.READ_RESULT)]
_JSON: dict[int | str, dict[str, Any]] = {200: {"model": trend_schemas.Comparison}, **refusals(409)}
_CSV: dict[int | str, dict[str, Any]] = {
    200: {"description": "The table", "content": {"text/csv": {"schema": BINARY}}},
    **refusals(409),
}


@router.get("/{other_id}", response_model=None, responses=_JSON)
def compare(
    session_id: Id, other_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader
) -> Response:
    """All parameters before and after, changes against MDC and MCID, and reasons for caution."""
    pair = _opened(db, trail, user, session_id, other_id)
    content = {
        "before": _session(pair.before),
        "after": _session(pair.after),
        "comparable": pair.comparable,
        "cautions": pair.cautions,
        "changes": [
            {**vars(r.change), "words": r.words.verdict} for r in comparisons.compare_sessions(reviewed, pair)
        ],
    }
    return JSONResponse(reduce_to_plain(content))


@router.get("/{other_id}/changes.csv", response_class=Response, responses=_CSV)
def compare_as_table(
    session_id: Id, other_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader
) -> Response:
    """The comparison as a table."""
    pair = _opened(db, trail, user, session_id, other_id)
    name = f"changes-{pair.before.session.id[:8]}-{pair.after.session.id[:8]}.csv"
    return attachment(comparison_csv(comparisons.compare_sessions(reviewed, pair)), name)


def _opened(db: Database, trail: AuditTrail, user: Identity, session_id: str, other_id: str) -> SessionPair:
    with db.read() as c:
        session_pair = comparisons.pair(c, session_id, other_id)
    trail.record_opened(user, "comparison.opened", "session", session_id, {"with": other_id})
    return session_pair


def _session(a: AnalysedSession) -> dict[str, Any]:
    return {
        "session_id": a.session.id,
        "performed_on": a.session.performed_on.isoformat(),
        "title": a.session.title,
        "protocol": a.session.protocol,
        "condition": {**vars(a.condition), "words": a.condition.words},
        "analysis_id": a.found.id,
    }
