"""Report of a session's analysis, complete as JSON and in parts as tables."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path
from starlette.responses import Response

from sagittal.server.api import schemas
from sagittal.server.api.downloads.downloads import BINARY, attachment
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, sessions
from sagittal.server.context import Db, Id, OpenTrail, Reviewed
from sagittal.server.report.tables import curves_csv, parameters_csv
from sagittal.server.report.view.model import ReportModel
from sagittal.server.results import analyses, comparisons, controls, edit_log, histories, reports
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.db import Database
from sagittal.server.trail import AuditTrail

router = APIRouter(prefix="/sessions/{session_id}", tags=["report"])
Reader = Annotated[Identity, require(Action.READ_RESULT)]
_CSV: dict[int | str, dict[str, Any]] = {
    200: {"description": "The table", "content": {"text/csv": {"schema": BINARY}}}
}


@router.get("/report", response_model=schemas.ReportAnswer)
def read_report(
    session_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader
) -> dict[str, object]:
    """Data quality, parameters with norms, cycle curves with norm bands, strides, provenance."""
    return _opened(db, reviewed, trail, user, session_id).to_json()


@router.get("/parameters.csv", response_class=Response, responses=_CSV)
def read_parameters(session_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader) -> Response:
    """Table of parameters, left and right, with norms."""
    report = _opened(db, reviewed, trail, user, session_id)
    return attachment(parameters_csv(report), f"parameters-{session_id[:8]}.csv")


@router.get("/parameters/{name}", response_model=schemas.ParameterBehind)
def read_parameter(
    session_id: Id,
    name: Annotated[str, Path(pattern=r"^[a-z0-9_]{1,64}$")],
    db: Db,
    reviewed: Reviewed,
    trail: OpenTrail,
    user: Reader,
) -> dict[str, object]:
    """One parameter with its definition and the value of every stride, included or not."""
    with db.read() as c:
        session = sessions.get(c, session_id)
        patient = patients.get(c, session.patient_id)
        record = analyses.get_shown(c, session_id)
        edits = edit_log.edits_of(c, record.id)
        control_visits = controls.list_visits(c, patient, session)
    trail.record_opened(user, "parameter.opened", "session", session_id, {"parameter": name})
    return reports.behind_number(reviewed, record, edits, patient, session, name, control_visits).to_json()


@router.get("/curves.csv", response_class=Response, responses=_CSV)
def read_curves(session_id: Id, db: Db, reviewed: Reviewed, trail: OpenTrail, user: Reader) -> Response:
    """Cycle curves: mean and spread by side and percentage of the cycle, with norms."""
    return attachment(
        curves_csv(_opened(db, reviewed, trail, user, session_id)), f"curves-{session_id[:8]}.csv"
    )


def _opened(
    db: Database, reviewed: ReviewedAnalyses, trail: AuditTrail, user: Identity, session_id: str
) -> ReportModel:
    with db.read() as c:
        session = sessions.get(c, session_id)
        patient = patients.get(c, session.patient_id)
        record = analyses.get_shown(c, session_id)
        edits = edit_log.edits_of(c, record.id)
        previous = comparisons.find_previous(c, session, histories.list_analysed(c, patient.id))
        control_visits = controls.list_visits(c, patient, session)
    trail.record_opened(user, "report.opened", "session", session_id, {"analysis_id": record.id})
    return reports.read(reviewed, record, edits, patient, session, previous, control_visits)[1]
