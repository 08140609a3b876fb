"""Review of a session's analysis: current events and strides, edits, undo, redo, signals."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

import msgspec
import numpy as np
from fastapi import APIRouter, Query
from fastapi.responses import JSONResponse
from starlette.responses import Response

from sagittal.core.events.edits import read_edit
from sagittal.core.events.result import list_known
from sagittal.core.user_text import encode_user_text
from sagittal.server.api.documents import refusals
from sagittal.server.api.downloads.downloads import BINARY, attachment
from sagittal.server.api.results import review_schemas as schemas
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db, Id, OpenTrail, Reviewed
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.report.files.analysis_json import parameter_row
from sagittal.server.report.files.exports import events_csv, strides_csv
from sagittal.server.report.words.wording import explain_exclusion
from sagittal.server.results import analyses, edit_log, reviews, signals
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.db import Database
from sagittal.server.trail import AuditTrail

router = APIRouter(route_class=StrictJsonRoute, prefix="/sessions/{session_id}", tags=["review"])
Reader = Annotated[Identity, require(Action.READ_RESULT)]
Reviewer = Annotated[Identity, require(Action.REVIEW)]
Seen = Annotated[
    int | None,
    Query(ge=0, le=2**53, description="the version that was seen; an older one than the newest is refused"),
]
_REVIEW: dict[int | str, dict[str, Any]] = {200: {"model": schemas.Review}}
_MADE: dict[int | str, dict[str, Any]] = {201: {"model": schemas.Review}, **refusals(409)}
_CSV: dict[int | str, dict[str, Any]] = {
    200: {"description": "The table", "content": {"text/csv": {"schema": BINARY}}}
}


@router.get("/edits", response_model=None, responses=_REVIEW)
def read_review(session_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader) -> Response:
    """Current events, strides and parameters, and the edits applied."""
    return _review(reviewed, *_opened(db, trail, user, session_id, "review"))


@router.post("/edits", status_code=201, response_model=None, responses=_MADE)
def make_edit(
    session_id: Id, body: schemas.EditNew, db: Db, reviewed: Reviewed, user: Reviewer, seen: Seen = None
) -> Response:
    """Move, add or delete an event, or exclude or include a stride; parameters are recomputed."""
    edit = read_edit(body.model_dump(exclude_none=True))
    record, edits = reviews.make(db, reviewed, user, session_id, edit, base_version=seen)
    return _review(reviewed, record, edits, 201)


@router.delete("/edits", response_model=None, responses=_REVIEW | refusals(409))
def undo_edit(session_id: Id, db: Db, reviewed: Reviewed, user: Reviewer, seen: Seen = None) -> Response:
    """Undo the latest edit."""
    return _review(reviewed, *reviews.undo(db, user, session_id, base_version=seen))


@router.post("/edits/redo", response_model=None, responses=_REVIEW | refusals(409))
def redo_edit(session_id: Id, db: Db, reviewed: Reviewed, user: Reviewer, seen: Seen = None) -> Response:
    """Redo the edit that was undone last; a new edit clears the redo history."""
    return _review(reviewed, *reviews.redo(db, reviewed, user, session_id, base_version=seen))


@router.get("/events.csv", response_class=Response, responses=_CSV)
def read_events(session_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader) -> Response:
    """Current contacts and foot-offs as a table; edited ones have the source "manual"."""
    record, edits = _opened(db, trail, user, session_id, "events")
    events = reviewed.read_bundle(record, edits).events
    return attachment(events_csv(events), f"events-{session_id[:8]}.csv")


@router.get("/strides.csv", response_class=Response, responses=_CSV)
def read_strides(session_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader) -> Response:
    """Current strides with their parameters as a table."""
    record, edits = _opened(db, trail, user, session_id, "strides")
    result = reviewed.measure(record, edits)
    content = (
        analyses.file_bytes(reviewed.blobs, record, "strides.csv")
        if result is None
        else strides_csv(result.strides, result.columns)
    )
    return attachment(content, f"strides-{session_id[:8]}.csv")


@router.get("/signals", response_model=list[signals.SignalLane])
def list_signals(
    session_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader
) -> tuple[signals.SignalLane, ...]:
    """List available signals: derived ones of feet and joints, raw ones of every sensor."""
    record = _watched(db, trail, user, session_id)
    return signals.list_lanes(reviewed, record)


@router.get("/signals/{name}", response_model=None, responses={200: {"model": signals.SignalWindow}})
def read_signal(
    session_id: Id,
    name: str,
    db: Db,
    reviewed: Reviewed,
    trail: OpenTrail,
    user: Reader,
    start_s: Annotated[float, Query(ge=0, le=1e6, allow_inf_nan=False)] = 0.0,
    end_s: Annotated[float, Query(ge=0, le=1e6, allow_inf_nan=False)] = 1e6,
    points: Annotated[int, Query(ge=1, le=signals.MOST_POINTS)] = 1000,
) -> Response:
    """A window of a signal, downsampled to minimum and maximum per bin."""
    record = _watched(db, trail, user, session_id)
    return JSONResponse(asdict(signals.read_window(reviewed, record, name, start_s, end_s, points)))


def _watched(db: Database, trail: AuditTrail, user: Identity, session_id: str) -> analyses.AnalysisRecord:
    """Record access once, since signals are requested at every zoom step."""
    with db.read() as c:
        record = analyses.get_shown(c, session_id)
    trail.record_watched(user, "signals.opened", "session", session_id, {"analysis_id": record.id})
    return record


def _opened(
    db: Database, trail: AuditTrail, user: Identity, session_id: str, resource: str
) -> tuple[analyses.AnalysisRecord, edit_log.EditHistory]:
    with db.read() as c:
        record = analyses.get_shown(c, session_id)
        edits = edit_log.edits_of(c, record.id)
    trail.record_opened(user, f"{resource}.opened", "session", session_id, {"analysis_id": record.id})
    return record, edits


def _review(
    reviewed: ReviewedAnalyses,
    record: analyses.AnalysisRecord,
    edits: edit_log.EditHistory,
    status: int = 200,
) -> Response:
    """Response without model validation, which would take longer for two thousand events than
    computing them.
    """
    bundle = reviewed.read_bundle(record, edits)
    events, strides, stride_columns = bundle.events.events, bundle.strides.strides, bundle.strides.columns
    times = np.round(np.array([e.time_s for e in events], np.float64), 6).tolist()
    starts, offs, ends = (
        list_known(np.round(x, 6))
        for x in (stride_columns.start_s, stride_columns.tc_s, stride_columns.end_s)
    )
    content = {
        "analysis_id": record.id,
        "editable": reviewed.open(record).tracks is not None,
        "version": edits.version,
        "redoable": len(edits.undone),
        "edits": [{"seq": m.seq, "by": m.by, "at": m.at.isoformat(), **m.edit.to_json()} for m in edits.made],
        "events": [
            {
                "side": e.side,
                "kind": e.kind,
                "time_s": time_s,
                "source": e.source,
                "confidence": e.confidence,
                "uncertainty_s": e.uncertainty_s,
            }
            for e, time_s in zip(events, times, strict=True)
        ],
        "strides": [
            {
                "side": s.side,
                "start_s": start_s,
                "tc_s": tc_s,
                "end_s": end_s,
                "flags": s.flags,
                "excluded_by": s.excluded_by,
                "excluded": None if s.excluded_reason is None else explain_exclusion(s.excluded_reason),
            }
            for s, start_s, tc_s, end_s in zip(strides, starts, offs, ends, strict=True)
        ],
        "parameters": [parameter_row(p) for p in bundle.parameters],
    }
    return Response(
        msgspec.json.encode(content, enc_hook=encode_user_text), status, media_type="application/json"
    )
