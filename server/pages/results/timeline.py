"""Strides, events and signals over time, for review and correction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.context import Db, Id, OpenTrail, Reviewed
from sagittal.server.http.templates import render
from sagittal.server.pages.results.charts import KEY_HEIGHT, draw_chart
from sagittal.server.pages.results.report_rows import select_first
from sagittal.server.pages.results.session import view_strides
from sagittal.server.pages.results.session_context import lead_to_days, read_measured_context
from sagittal.server.pages.shell import FRAGMENT, record_opening, render_page
from sagittal.server.report.view.model import ReportModel
from sagittal.server.results import analyses, edit_log, reports, signals
from sagittal.server.results.reviewed import ReviewedAnalyses

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/sessions/{sid}/timeline")
def show_timeline(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    sid: Id,
    user: Annotated[Identity, require(Action.READ_RESULT)],
) -> Response:
    """Strides, events and signals over time, for review and correction."""
    with db.read() as c:
        context = read_measured_context(c, sid)
        if elsewhere := lead_to_days(context):
            return elsewhere
        latest = analyses.latest(c, sid)
        edits = edit_log.EditHistory() if latest is None else edit_log.edits_of(c, latest.id)
    if latest is not None:
        model = read_model(reviewed, latest, edits, context)
        context["numbers"] = view_numbers(model)
        context["replay"] = {**model.replay, "curves": {}}
        context["lanes"] = [vars(lane) for lane in signals.list_lanes(reviewed, latest)]
        context["fixed_because"] = reviewed.open(latest).fixed_because
        context["editable"] = context["fixed_because"] is None and user.may(Action.REVIEW)
    record_opening(request, user, "session", sid)
    return render_page(request, db, user, "timeline.html", "patients", **context)


@router.get("/sessions/{sid}/timeline/numbers")
def show_numbers(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    trail: OpenTrail,
    sid: Id,
    user: Annotated[Identity, require(Action.READ_RESULT)],
) -> Response:
    """Part of the timeline page updated after an edit; redirects to the page if requested directly."""
    if FRAGMENT not in request.headers:
        return RedirectResponse(f"/sessions/{sid}/timeline#numbers", status_code=303)
    with db.read() as c:
        context = read_measured_context(c, sid)
        latest = analyses.get_shown(c, sid)
        edits = edit_log.edits_of(c, latest.id)
    trail.record_watched(user, "numbers.opened", "session", sid)
    numbers = view_numbers(read_model(reviewed, latest, edits, context))
    return render(request, "_numbers.html", {"numbers": numbers})


def read_model(
    reviewed: ReviewedAnalyses,
    record: analyses.AnalysisRecord,
    edits: edit_log.EditHistory,
    context: Mapping[str, Any],
) -> ReportModel:
    """Report of an analysis without comparison to other visits."""
    patient, session = context["patient"], context["session"]
    return reports.read(reviewed, record, edits, patient, session, None, context["controls"])[1]


def view_numbers(model: ReportModel) -> dict[str, Any]:
    """Part of the report shown with the timeline, which changes with every edit."""
    return {
        **view_strides(model),
        "first": select_first(model),
        "key_curve": draw_chart(model.key_curve, KEY_HEIGHT, x_unit=True),
    }
