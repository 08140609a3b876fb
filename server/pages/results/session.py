"""Report of a session: overview, all curves, and printed pages."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Annotated, Any, Final

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.responses import Response

from sagittal.core.errors import FormatError, title_of_code
from sagittal.core.message import Message
from sagittal.core.parameters.catalogue.entry import SQUAT
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.context import Config, Db, Id, Reviewed, state_of
from sagittal.server.pages.clinic.identity import name_on_paper
from sagittal.server.pages.results import daily
from sagittal.server.pages.results.charts import (
    COLUMNS,
    GLANCE_HEIGHT,
    KEY_HEIGHT,
    PAGE_HEIGHTS,
    PAPER_HEIGHTS,
    draw_chart,
)
from sagittal.server.pages.results.figures import draw_beginning, draw_contact
from sagittal.server.pages.results.first_sheet import has_room_for_profile
from sagittal.server.pages.results.profile import view_profile
from sagittal.server.pages.results.report_rows import (
    FIRST_ROWS,
    SECONDARY,
    fold_groups,
    select_first,
    select_groups,
    select_others,
)
from sagittal.server.pages.results.session_context import lead_to_days, read_measured_context
from sagittal.server.pages.results.takes import view_takes
from sagittal.server.pages.shell import FRAGMENT, record_opening, render_page, render_sheets
from sagittal.server.pages.words import PROTOCOL_NAMES, TEST_NAMES, describe_person
from sagittal.server.report.charts.curves import GLANCE_STRIDES, strip_svg
from sagittal.server.report.history.trend_strip import LEAST_VISITS, TrendStrip, trend_strip
from sagittal.server.report.history.trends import AnalysedVisit, VisitKind
from sagittal.server.report.view.model import ReportModel
from sagittal.server.report.view.profile import BAR_HEIGHT, PAPER_BAR_HEIGHT
from sagittal.server.report.words.wording import speak_places
from sagittal.server.results import comparisons, feedback, histories, repairs, reports
from sagittal.server.results.controls import ControlVisit
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.sharing import signed_reports
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import IntegrityError
from sagittal.server.uploads import videos
from sagittal.web.words import day, seconds

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

SEVERITIES: Final = ("bad", "warn", "info")

NO_STRIDE_CODES: Final = ("foot_missing", "no_strides", "few_steps")
"""Notices that explain a trial without strides."""

OVERVIEW, CURVES, PAPER, VALUES = "session.html", "kinematics.html", "print.html", "_values.html"

STRIP_STRIDES: Final = {OVERVIEW: 64, CURVES: 150}
"""Longer walks have too many strides for the strip next to the avatar and for the overview's 80 kB; the
timeline shows them.
"""

FIRST_CURVES: Final = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")

SHOWN: Final = (
    "problem",
    "quality",
    "strides",
    "duration_s",
    "norm_note",
    "has_sides",
    "curve_notes",
    "replay",
    "condition",
    "profile",
    "limits",
    "squats",
    "headline",
    "functional",
)
"""Attributes of ReportModel used directly by templates."""


@router.get("/sessions/{sid}")
def show_overview(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    sid: Id,
    user: Annotated[Identity, require(Action.READ_SESSION)],
) -> Response:
    """Data quality and summary of the gait."""
    return _show_report(request, db, reviewed, sid, user, OVERVIEW)


@router.get("/sessions/{sid}/kinematics")
def show_kinematics(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    sid: Id,
    user: Annotated[Identity, require(Action.READ_RESULT)],
) -> Response:
    """All cycle curves with the replay."""
    return _show_report(request, db, reviewed, sid, user, CURVES)


@router.get("/sessions/{sid}/values")
def show_values(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    sid: Id,
    user: Annotated[Identity, require(Action.READ_RESULT)],
) -> Response:
    """All other values by group: a page, and the part of the overview loaded with its first expanded
    group.
    """
    template = VALUES if FRAGMENT in request.headers else "values.html"
    return _show_report(request, db, reviewed, sid, user, template)


@router.get("/sessions/{sid}/print")
def show_print(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    settings: Config,
    sid: Id,
    user: Annotated[Identity, require(Action.READ_RESULT)],
    named: bool = False,
) -> Response:
    """A4 pages for the browser's print function: summary, all values, curves; with the name if requested."""
    context = gather_report(db, reviewed, sid, user, PAPER)
    if context["report"] is None:
        return RedirectResponse(f"/sessions/{sid}", status_code=303)
    record_opening(request, user, "session", sid)
    context |= name_on_paper(request, db, settings, user, context["patient"].id, named=named)
    return render_sheets(request, user, choose_template(PAPER, context), **context)


def _show_report(
    request: Request,
    db: Database,
    reviewed: ReviewedAnalyses,
    sid: str,
    user: Identity,
    template: str,
) -> Response:
    context = gather_report(db, reviewed, sid, user, template)
    if template == CURVES and (elsewhere := lead_to_days(context)):
        return elsewhere
    if template == VALUES:
        state_of(request).trail.record_watched(user, "numbers.opened", "session", sid)
    else:
        record_opening(request, user, "session", sid)
    chosen_template = choose_template(template, context)
    return render_page(request, db, user, chosen_template, "patients", **context)


def choose_template(template: str, context: Mapping[str, Any]) -> str:
    """Template of a page; daily life has its own."""
    is_daily = context["session"].protocol == "activity"
    return daily.TEMPLATES.get(template, template) if is_daily else template


def gather_report(
    db: Database,
    reviewed: ReviewedAnalyses,
    sid: str,
    user: Identity,
    template: str,
) -> dict[str, Any]:
    """Template context of a session's report; `report` is None if nothing is analysed."""
    paper = template == PAPER
    with db.read() as c:
        context = read_measured_context(c, sid)
        patient = context["patient"]
        done = histories.list_analysed(c, patient.id) if user.may(Action.READ_RESULT) else []
        this = next((a for a in done if a.session.id == sid), None)
        if this is not None:
            alike = comparisons.list_comparable(c, this.session, done)
            context |= {"before": comparisons.pick_previous(alike), "alike": alike if paper else []}
            trained = feedback.gather(c, patient, sid, done)
            if template == OVERVIEW and context["session"].has_video:
                context["video"] = videos.find(c, sid)
            if not paper and user.may(Action.ANALYSE):
                repair = repairs.read_proposal(c, reviewed.blobs, this.found)
                context["repair"] = repair
                if this.session.protocol in TEST_NAMES:
                    context["test_manifest"] = repairs.read_without_limits(c, this.found)
                if repair is not None:
                    context["repair_says"] = [speak_places(s) for s in repair.evidence]
                    context["repair_changes"] = [speak_places(s) for s in repair.changes]
        if paper:
            context["assessment"] = signed_reports.read_assessment(c, sid)
    if this is not None:
        context["report"] = view_report(reviewed, this, context, page=template)
        context["analysis"] = this.found
        if paper:
            context["profile_first"] = has_room_for_profile(
                context["report"], context["assessment"], context["session"].note
            )
        if template == OVERVIEW:
            context["takes"] = view_takes(reviewed, done, sid, context["report"]["first"])
        context["feedback"] = feedback.view(reviewed, trained)
    return context


def view_report(
    reviewed: ReviewedAnalyses, this: AnalysedSession, context: Mapping[str, Any], *, page: str
) -> Mapping[str, Any]:
    """Report of an analysis with rendered charts, cached for the same records."""
    previous: AnalysedSession | None = context.get("before")
    controls: Sequence[ControlVisit] = context["controls"]
    key = (
        page,
        context["patient"],
        _name(this),
        previous and _name(previous),
        *((_name(a), kind) for a, kind in context.get("alike", ())),
        *((v.person, v.sex, v.birth_year, v.performed_on, v.found.id, v.edits.key) for v in controls),
    )
    return reviewed.keep_page(key, lambda: _draw_report(reviewed, this, context, page))


def _name(visit: AnalysedSession) -> tuple[object, ...]:
    return visit.session, visit.found.id, visit.edits.key


def _draw_report(
    reviewed: ReviewedAnalyses, this: AnalysedSession, context: Mapping[str, Any], page: str
) -> dict[str, Any]:
    paper, overview = page == PAPER, page == OVERVIEW
    patient, session, record = context["patient"], context["session"], this.found
    bundle, model = reports.read(
        reviewed, record, this.edits, patient, session, context.get("before"), context["controls"]
    )
    used, total = sum(model.used.values()), len(model.strides)
    height = PAPER_BAR_HEIGHT if paper else BAR_HEIGHT
    score, bars = view_profile(reviewed, model, context, height) if overview or paper else (None, [])
    return {
        **{name: getattr(model, name) for name in SHOWN},
        **view_strides(model),
        "daily": daily.draw_daily(model.daily),
        "estimator": model.estimator,
        "groups": select_groups(model, paper=paper),
        "since": model.since,
        "not_compared": _not_compared(session, model),
        "first": (first := select_first(model)[: FIRST_ROWS - (score is not None)]),
        "score": score,
        "bars": bars,
        "others": select_others(model, first) if paper else [],
        "folds": fold_groups(model, first),
        "ranks": {} if model.headline is None else model.headline.ranks,
        "curve_ranks": {} if model.headline is None else model.headline.curve_ranks,
        "missing": [
            (r.title, r.reason.removeprefix("not measured: "))
            for name, rows in model.groups
            for r in rows
            if r.reason and name not in SECONDARY
        ],
        "warnings": _notices(model),
        "replay": _list_for_clock(model, FIRST_CURVES) if overview else model.replay,
        "curves": [] if overview else _draw_panels(model, PAPER_HEIGHTS if paper else PAGE_HEIGHTS),
        "sagittal": [
            draw_chart(p, GLANCE_HEIGHT if paper else KEY_HEIGHT, x_unit=overview, glance=True)
            for p in model.panels
            if (overview or paper) and p.variable.name in FIRST_CURVES and p.sides
        ],
        "still": draw_contact(reviewed, this, bundle.strides, patient) if paper and used else None,
        "first_picture": draw_beginning(reviewed, this, model) if page in (OVERVIEW, CURVES) else None,
        "strip": strip_svg(bundle.strides, model.duration_s)
        if 0 < total <= STRIP_STRIDES.get(page, 0)
        else "",
        "drawn": "some strides" if overview and max(model.used.values()) > GLANCE_STRIDES else "",
        "identity": _identity(patient, session, model.condition),
        "provenance_line": " · ".join(
            (
                f"Sagittal {record.code_version}",
                *(() if model.estimator is None else (model.estimator.name,)),
                f"settings {record.config_sha256[:8]}",
                f"input {record.input_sha256[:8]}",
                day(record.created_at),
            )
        ),
        "has_poses": "poses.parquet" in record.files,
        "trend": _follow(reviewed, model, context),
    }


def _follow(reviewed: ReviewedAnalyses, model: ReportModel, context: Mapping[str, Any]) -> TrendStrip | None:
    """Gait speed and score up to this visit under the same condition; None on screen or with too few visits.

    Trials of one day form one visit, represented by the last; those with poor or damaged data are omitted.
    """
    alike: Sequence[tuple[AnalysedSession, VisitKind]] = context.get("alike", ())
    if model.headline is None or model.quality.kind == "bad" or len(alike) < LEAST_VISITS:
        return None
    visits: dict[dt.date, AnalysedVisit] = {}
    for a, kind in alike:
        with suppress(IntegrityError, FormatError):  # its own page reports the problem
            visit = histories.read_visit(reviewed, a, kind)
            if visit.numbers.verdict[0] != "bad":
                visits[visit.performed_on] = visit
    return trend_strip(list(visits.values()), context["patient"].affected_side)


def _draw_panels(model: ReportModel, heights: Mapping[bool, int]) -> list[dict[str, Any]]:
    """All cycle charts; those of the last row include the unit of the x axis."""
    last_row = len(model.panels) - COLUMNS
    return [draw_chart(p, heights[i >= last_row], x_unit=i >= last_row) for i, p in enumerate(model.panels)]


def _list_for_clock(model: ReportModel, variables: Sequence[str]) -> dict[str, Any]:
    """Data for the page's clock, with some curves only, rounded to whole degrees."""
    curves: Mapping[str, Any] = model.replay["curves"]  # type: ignore[assignment]
    spans: Sequence[Mapping[str, Any]] = model.replay["strides"]  # type: ignore[assignment]
    strides = [[s["side"], s["start_s"], s["end_s"], int(s["used"])] for s in spans]
    whole = {
        v: {
            side: mean and [None if x is None else math.floor(x + 0.5) for x in mean]
            for side, mean in curves[v].items()
        }
        for v in variables
        if v in curves
    }
    return {**model.replay, "strides": strides, "curves": whole}


def view_strides(model: ReportModel) -> dict[str, Any]:
    """Summary of strides for overview and timeline: number used, norms, and reason if there are none."""
    return {
        "used": model.used,
        "norm_source": model.norm_source,
        "at_speed": model.at_speed,
        "stride_words": Message(
            "{sum} of {strides} included", sum=sum(model.used.values()), strides=len(model.strides)
        ),
        "empty_reason": explain_emptiness(model),
    }


def explain_emptiness(model: ReportModel) -> str:
    """Reason why an analysis has no strides or squats to show."""
    causes = [w.message for code in NO_STRIDE_CODES for w in model.warnings if w.code == code]
    cycle = "squat" if any(name == SQUAT for name, _ in model.groups) else "stride"
    read = Message(
        "{duration_s} of data were read but contain no complete {cycle}.",
        duration_s=seconds(model.duration_s),
        cycle=cycle,
    )
    if cycle == "squat":
        return model.problem or Message(
            "{read} A squat flexes the knee by at least 20° and returns.", read=read
        )
    question = "Check that there is a sensor on each foot and that it is assigned correctly."
    return model.problem or " ".join([read, *(causes or [question])])


def _notices(model: ReportModel) -> list[dict[str, Any]]:
    """Notices by severity, grouped by kind; errors that stopped the analysis are shown separately."""
    boxes: dict[tuple[str, str], dict[str, Any]] = {}
    for w in sorted(model.warnings, key=lambda w: SEVERITIES.index(w.kind)):
        if w.message == model.problem:
            continue
        box = boxes.setdefault((w.kind, w.code), {"kind": w.kind, "title": w.title, "messages": []})
        if box["messages"]:
            box["title"] = title_of_code(w.code)
        box["messages"].append(w.message)
    return list(boxes.values())


def _not_compared(session: Session, model: ReportModel) -> str | None:
    """Reason why the table has no column of changes, None if it has."""
    if model.since is not None:
        return None
    if session.feedback:
        return "Walked with feedback: shown, not compared with other visits."
    return Message(
        "No earlier visit in this condition to compare with: {condition}.", condition=model.condition
    )


def _identity(patient: Patient, session: Session, condition: str) -> list[tuple[str, str]]:
    height = patient.find_height(session)
    return [
        ("Code", patient.code),
        ("Age, sex", describe_person(patient.sex, patient.birth_year) or "not given"),
        ("Height", f"{height:.2f} m" if height else "not given"),
        ("Protocol", PROTOCOL_NAMES.get(session.protocol, session.protocol)),
        ("Condition" if session.protocol == "squat" else "Walked", condition),
        ("Date", day(session.performed_on)),
    ]
