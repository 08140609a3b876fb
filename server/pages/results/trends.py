"""Parameters over the visits of a patient."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.core.activity.parameters import WORN_H
from sagittal.core.frames import Protocol, Side
from sagittal.core.parameters.catalogue import require_entries
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients
from sagittal.server.context import HEX_ID, Db, Id, Reviewed
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.report.history.daily_trend import PerformanceDay, draw_daily_trend
from sagittal.server.report.history.trend_chart import PlannedAssessment, trend_svg
from sagittal.server.report.history.trends import (
    PRIMARY,
    AnalysedVisit,
    Trend,
    TrendSeries,
    follow_figures,
    names_in,
)
from sagittal.server.report.words.change_words import SCORE_TERMS, change_words, find_term
from sagittal.server.report.words.daily_words import format_hours
from sagittal.server.report.words.wording import GROUPS, format_number
from sagittal.server.results import histories
from sagittal.server.results.histories import PatientHistory
from sagittal.web.words import day

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

Shown = Annotated[
    list[Annotated[str, Query(max_length=64)]], Query(alias="show", max_length=100, default_factory=list)
]

FIGURES: Final = (
    "gait_speed_mps",
    "step_length_m",
    "stance_pct",
    "knee_flexion_max_swing_deg",
    "gps_sagittal_deg",
    "knee_flexion_rom_deg",
    "cadence_spm",
    "foot_pitch_ic_deg",
    "stride_time_s",
    "double_support_pct",
)
"""On the patient's page: the trained parameter, then the first of these that are available."""

require_entries((name for name in FIGURES if name not in SCORE_TERMS), "sagittal.server.pages.results.trends")
FIGURES_SHOWN: Final = 5
FIGURE_HEIGHT: Final = 128


@router.get("/patients/{pid}/trends")
def show_trends(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    pid: Id,
    user: Annotated[Identity, require(Action.READ_RESULT)],
    show: Shown,
    protocol: Protocol | None = None,
    like: Annotated[str | None, Query(pattern=HEX_ID)] = None,
) -> Response:
    """Parameters over the visits of a patient."""
    with db.read() as c:
        patient = patients.get(c, pid)
        done, plans = histories.read(c, patient)
    history = histories.read_history(reviewed, patient, done, plans, protocol, like)
    record_opening(request, user, "patient", pid)
    view = view_trends(history, show)
    performance = histories.read_performance(reviewed, done)
    if performance:
        walks = [a for a in done if a.session.protocol != "activity"]
        walked = histories.read_history(reviewed, patient, walks, plans) if walks else None
        displayed = history if history.condition and history.condition.protocol != "activity" else walked
        view["daily"] = view_daily_trend(displayed, performance)
    return render_page(request, db, user, "trends.html", "patients", patient=patient, trends=view)


def list_ahead(history: PatientHistory) -> list[PlannedAssessment]:
    """Upcoming assessments of the latest programme."""
    plans = history.programmes[:1]
    return [
        PlannedAssessment(v.label, v.planned_on)
        for plan in plans
        for v in plan.visits
        if v.kind == "assessment" and v.state in {"next", "planned"}
    ]


def view_daily_trend(walked: PatientHistory | None, performance: Sequence[PerformanceDay]) -> dict[str, Any]:
    """Capacity and performance on a common time axis, and a table of all values.

    Parameters
    ----------
    walked : clinic visits under the same condition, None if there are none.
    """
    capacity = [] if walked is None else histories.read_capacity(walked)
    rows = [
        {
            "day": v.day,
            "href": f"/sessions/{v.session_id}",
            "where": "clinic",
            "speed": None if v.speed_mps is None else format_number(v.speed_mps, 2),
            "steps": None,
            "cadence": None if v.cadence_spm is None else format_number(v.cadence_spm, 0),
            "worn": None,
        }
        for v in capacity
    ] + [
        {
            "day": d.day,
            "href": f"/sessions/{d.session_id}",
            "where": "home" if d.counted else "home, wear time too short",
            "speed": None,
            "steps": str(d.steps),
            "cadence": None if d.cadence_spm is None else format_number(d.cadence_spm, 0),
            "worn": format_hours(60.0 * d.worn_h),
        }
        for d in performance
    ]
    return {
        "panels": draw_daily_trend(capacity, performance),
        "rows": sorted(rows, key=lambda row: row["day"]),
        "has_capacity": bool(capacity),
        "condition": None if walked is None or walked.condition is None else walked.condition.words,
        "worn_h": f"{WORN_H:.0f}",
    }


def draw_figures(history: PatientHistory, trained: str | None) -> dict[str, Any] | None:
    """Five parameters over the visits of one condition, one side each; None without a visit.

    Parameters
    ----------
    trained : parameter of the prescription in force, None = none.
    """
    available = set(names_in(history.visits))
    names = [n for n in dict.fromkeys((trained, *FIGURES)) if n in available][:FIGURES_SHOWN]
    affected = history.patient.affected_side
    trends = follow_figures(history.visits, names, history.norms, history.usual, affected)
    if not trends:
        return None
    coming = list_ahead(history)
    figures = []
    for t in trends:
        line = _pick_side(t, affected)
        last = line.points[-1 if line.latest is None else line.latest]
        drawn = _figure(t, line, history.visits, coming, FIGURE_HEIGHT, small=True)
        figures.append({**drawn, "value": format_number(last.value, t.term.digits)})
    selected = [(t, line) for t in trends for line in (_pick_side(t, affected),)]
    return {
        "figures": figures,
        "condition": None if history.condition is None else history.condition.words,
        "others": len(history.others),
        "has_mdc": any(line.mdc is not None for _, line in selected),
        "has_mcid": False,
        "has_estimated": any(p.estimated for _, line in selected for p in line.points),
        "has_training": any(v.kind == "training" for v in history.visits),
        "norms": any(t.norm is not None for t in trends),
    }


def _pick_side(trend: Trend, affected: Side | None) -> TrendSeries:
    """The side shown for a parameter: the affected side, otherwise the one further from the norm."""
    mine = next((line for line in trend.lines if line.side == affected), None)
    if mine is not None or trend.norm is None:
        return mine or trend.lines[0]
    norm = trend.norm
    return max(trend.lines, key=lambda line: abs(line.points[-1].value - norm.mean))


def view_trends(history: PatientHistory, chosen: Sequence[str], height: int = 196) -> dict[str, Any]:
    """Template context: charts of the selected parameters, selection, limits with sources, and table.

    Parameters
    ----------
    height : of a chart in px.
    """
    available = names_in(history.visits)
    names = [n for n in available if n in chosen] or [n for n in PRIMARY if n in available]
    names = names or list(available[: len(PRIMARY)])
    trends = follow_figures(
        history.visits, names, history.norms, history.usual, history.patient.affected_side
    )
    groups: dict[str, list[dict[str, Any]]] = {}
    for name in available:
        term = find_term(name)
        groups.setdefault(term.group, []).append(
            {"name": name, "title": term.label, "unit": term.unit, "on": name in names}
        )
    return {
        **_shown(history, trends, height),
        "groups": list(groups.items()),
        "query": "&".join(f"show={name}" for name in names),
        "condition": None if history.condition is None else history.condition.words,
        "like": history.visits[-1].session_id if history.visits else None,
        "others": [(o.session_id, o.condition.words, o.count) for o in history.others],
        "visits": [_column(v) for v in history.visits],
        "rows": [row for trend in trends for row in _rows(trend, history.visits)],
    }


def _shown(history: PatientHistory, trends: Sequence[Trend], height: int) -> dict[str, Any]:
    coming = list_ahead(history)
    lines = [(t, line) for t in trends for line in t.lines]
    sources: dict[str, list[str]] = {}
    for t, line in lines:
        change = line.change
        for sentence in () if change is None else change_words(change).limits:
            sources.setdefault(sentence, []).append(t.term.label)
    norms: dict[str, list[str]] = {}
    for t in trends:
        if t.norm is not None:
            norms.setdefault(f"{GROUPS.get(t.norm.group, t.norm.group)} ({t.norm.source})", []).append(
                t.term.label
            )
    return {
        "figures": [_figure(t, line, history.visits, coming, height) for t, line in lines],
        "limits": [(", ".join(dict.fromkeys(labels)), s) for s, labels in sources.items()],
        "norms": [(", ".join(labels), s) for s, labels in norms.items()],
        "has_mdc": any(line.mdc is not None for _, line in lines),
        "has_mcid": any(line.mcid is not None for _, line in lines),
        "has_estimated": any(p.estimated for _, line in lines for p in line.points),
        "has_training": any(v.kind == "training" for v in history.visits),
    }


def _figure(
    trend: Trend,
    line: TrendSeries,
    visits: Sequence[AnalysedVisit],
    coming: Sequence[PlannedAssessment],
    height: int,
    *,
    small: bool = False,
) -> dict[str, Any]:
    change = line.change
    base = None if line.base is None else visits[line.points[line.base].visit]
    return {
        "title": trend.term.label,
        "unit": trend.term.unit,
        "side": line.side,
        "svg": trend_svg(trend, line, visits, coming, height, small=small),
        "words": None if change is None else change_words(change),
        "since": None if base is None else base.label or day(base.performed_on),
        "waiting": _waiting(line),
    }


def _waiting(line: TrendSeries) -> str:
    """Text shown until there are two assessments."""
    if line.base is None:
        return "no assessment yet"
    if line.points[line.base].estimated:
        return "one estimated assessment so far"
    mixed = any(p.estimated for p in line.points)
    return "one measured assessment so far" if mixed else "one assessment so far"


def _column(v: AnalysedVisit) -> dict[str, Any]:
    return {
        "href": f"/sessions/{v.session_id}",
        "label": v.label,
        "day": v.performed_on,
        "training": None if v.kind == "assessment" else "with feedback" if v.feedback else "training",
    }


def _rows(trend: Trend, visits: Sequence[AnalysedVisit]) -> list[dict[str, Any]]:
    """One row per side: values of all visits, then the assessment of the change."""
    rows = []
    for line in trend.lines:
        by_visit = {p.visit: p for p in line.points}
        cells = []
        for i in range(len(visits)):
            p = by_visit.get(i)
            mark = "" if p is None or p.change is None else change_words(p.change).mark
            text = None if p is None else format_number(p.value, trend.term.digits)
            cells.append({"text": text, "mark": mark, "estimated": p is not None and p.estimated})
        change = line.change
        rows.append(
            {
                "title": trend.term.label,
                "unit": trend.term.unit,
                "side": line.side,
                "first": line is trend.lines[0],
                "span": len(trend.lines),
                "cells": cells,
                "words": None if change is None else change_words(change),
                "waiting": _waiting(line),
            }
        )
    return rows
