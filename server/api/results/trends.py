"""Parameters over the visits of a patient: changes since the first assessment and their certainty."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query
from fastapi.responses import JSONResponse
from starlette.responses import Response

from sagittal.core.frames import Protocol
from sagittal.core.subject.condition import WalkingCondition
from sagittal.server.api.downloads.downloads import BINARY, attachment
from sagittal.server.api.results import trend_schemas
from sagittal.server.api.schemas import HexId
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients
from sagittal.server.context import Db, Id, OpenTrail, Reviewed
from sagittal.server.report.files.columns import reduce_to_plain
from sagittal.server.report.history.trends import Trend, TrendSeries, follow_figures, names_in
from sagittal.server.report.tables import trends_csv
from sagittal.server.report.words.change_words import change_words
from sagittal.server.results import histories
from sagittal.server.results.histories import PatientHistory

router = APIRouter(prefix="/patients/{patient_id}", tags=["trends"])
Names = Annotated[
    list[Annotated[str, Query(max_length=64)]],
    Query(
        alias="show",
        max_length=100,
        default_factory=list,
        description="names of figures; none = all that were measured",
    ),
]
Walked = Annotated[Protocol | None, Query(description="visits of this protocol only")]
Like = Annotated[
    HexId | None,
    Query(
        description="visits walked as in this session; none = as in the newest one at the person's own pace "
        "and without feedback, else as in the newest"
    ),
]
_JSON: dict[int | str, dict[str, Any]] = {200: {"model": trend_schemas.Trends}}
_CSV: dict[int | str, dict[str, Any]] = {
    200: {"description": "The table", "content": {"text/csv": {"schema": BINARY}}}
}


def _follow(
    patient_id: Id,
    db: Db,
    reviewed: Reviewed,
    trail: OpenTrail,
    user: Annotated[Identity, require(Action.READ_RESULT)],
    show: Names,
    protocol: Walked = None,
    like: Like = None,
) -> tuple[PatientHistory, tuple[Trend, ...]]:
    with db.read() as c:
        patient = patients.get(c, patient_id)
        done, plans = histories.read(c, patient)
    trail.record_opened(user, "trends.opened", "patient", patient_id)
    history = histories.read_history(reviewed, patient, done, plans, protocol, like)
    available = names_in(history.visits)
    names = [n for n in show if n in available] if show else available
    return history, follow_figures(
        history.visits, names, history.norms, history.usual, history.patient.affected_side
    )


Followed = Annotated[tuple[PatientHistory, tuple[Trend, ...]], Depends(_follow)]
"""The patient's history and the requested parameters; access is checked and audited."""


@router.get("/trends", response_model=None, responses=_JSON)
def read_trends(followed: Followed) -> Response:
    """Values by visit with norms, and changes since the first assessment against MDC and MCID."""
    history, trends = followed
    visits = [
        {
            "session_id": v.session_id,
            "performed_on": v.performed_on.isoformat(),
            "title": v.title,
            "label": v.label,
            "kind": v.kind,
            "condition": _condition(v.condition),
        }
        for v in history.visits
    ]
    walked = history.condition
    content = {
        "protocol": None if walked is None else walked.protocol,
        "condition": None if walked is None else _condition(walked),
        "visits": visits,
        "others": [{**vars(o), "condition": _condition(o.condition)} for o in history.others],
        "trends": [_trend(t) for t in trends],
    }
    return JSONResponse(reduce_to_plain(content))


@router.get("/trends.csv", response_class=Response, responses=_CSV)
def read_trends_table(patient_id: Id, followed: Followed) -> Response:
    """The trends as a table: one row per parameter, side and visit."""
    history, trends = followed
    return attachment(trends_csv(history.visits, trends), f"trends-{patient_id[:8]}.csv")


def _condition(walked: WalkingCondition) -> dict[str, Any]:
    return {**vars(walked), "words": walked.words}


def _trend(trend: Trend) -> dict[str, Any]:
    return {
        "name": trend.name,
        "title": trend.term.label,
        "unit": trend.term.unit,
        "norm": trend.norm,
        "lines": [_line(line) for line in trend.lines],
    }


def _line(line: TrendSeries) -> dict[str, Any]:
    change = line.change
    return {
        "side": line.side,
        "mdc": line.mdc,
        "mcid": line.mcid,
        "points": line.points,
        "base": line.base,
        "latest": line.latest,
        "words": None if change is None else change_words(change).verdict,
    }
