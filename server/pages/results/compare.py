"""Comparison of two visits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.responses import Response

from sagittal.core.change import sort_changes
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients
from sagittal.server.context import HEX_ID, Db, Id, Reviewed
from sagittal.server.pages.results.charts import COLUMNS, PAGE_HEIGHTS, caption_chart
from sagittal.server.pages.results.report_rows import SECONDARY
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.report.charts.curves import cycle_svg
from sagittal.server.report.charts.panels import CurvePanel, same_zero
from sagittal.server.report.history.comparison import ComparedRow
from sagittal.server.results import comparisons, reports
from sagittal.server.results.comparisons import SessionPair
from sagittal.server.results.reviewed import ReviewedAnalyses

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

ResultReader = Annotated[Identity, require(Action.READ_RESULT)]

Ticked = Annotated[list[Annotated[str, Query(pattern=HEX_ID)]], Query(max_length=100, default_factory=list)]


@router.get("/patients/{pid}/compare")
def choose_visits(db: Db, pid: Id, user: ResultReader, visit: Ticked) -> Response:
    """Redirect to the comparison of two selected visits, or back if not exactly two are selected."""
    with db.read() as c:
        patients.get(c, pid)
    to = f"/sessions/{visit[0]}/compare/{visit[1]}" if len(set(visit)) == 2 else f"/patients/{pid}"
    return RedirectResponse(to, status_code=303)


@router.get("/sessions/{sid}/compare/{other}")
def show_comparison(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    sid: Id,
    other: Id,
    user: ResultReader,
) -> Response:
    """Two sessions: overlaid curves, all parameters before and after, summary in words."""
    with db.read() as c:
        session_pair = comparisons.pair(c, sid, other)
    record_opening(request, user, "session", session_pair.before.session.id)
    record_opening(request, user, "session", session_pair.after.session.id)
    view = view_comparison(reviewed, session_pair)
    return render_page(
        request,
        db,
        user,
        "compare.html",
        "patients",
        patient=session_pair.patient,
        pair=session_pair,
        compare=view,
    )


def view_comparison(reviewed: ReviewedAnalyses, pair: SessionPair) -> dict[str, Any]:
    """Template context: charts with earlier means, table with headings, sources."""
    rows = comparisons.compare_sessions(reviewed, pair)
    _, old = reports.read(reviewed, pair.before.found, pair.before.edits, pair.patient, pair.before.session)
    _, new = reports.read(reviewed, pair.after.found, pair.after.edits, pair.patient, pair.after.session)
    last_row = len(new.panels) - COLUMNS
    charts, drawn = [], []
    for i, (earlier_panel, later) in enumerate(zip(old.panels, new.panels, strict=True)):
        is_last_row = i >= last_row
        earlier, panel = same_zero(earlier_panel, later)
        svg = cycle_svg(
            panel, height=PAGE_HEIGHTS[is_last_row], x_unit=is_last_row, single_strides=False, earlier=earlier
        )
        charts.append({**caption_chart(panel, svg), "gone": _gone(earlier)})
        drawn.append(panel)
    merged = replace(new, panels=tuple(drawn))
    groups: dict[str, list[ComparedRow]] = {}
    for row in rows:
        groups.setdefault(row.group, []).append(row)
    sources: dict[str, list[str]] = {}
    for row in rows:
        for sentence in row.words.limits:
            sources.setdefault(sentence, []).append(row.title)
    facts = sort_changes([row.change for row in rows])
    row_of = {(row.change.name, row.side): row for row in rows}
    real = [
        (row_of[fact.change.name, fact.change.side], [row_of[c.name, c.side] for c in fact.same])
        for fact in facts.real
    ]
    return {
        "charts": charts,
        "groups": [(name, _pairs(mine)) for name, mine in groups.items() if name not in SECONDARY],
        "more": [(name, _pairs(mine)) for name, mine in groups.items() if name in SECONDARY],
        "limits": [(list(dict.fromkeys(titles)), s) for s, titles in sources.items()],
        "real": real,
        "within": facts.within,
        "unjudged": facts.unjudged,
        "comparable": pair.comparable,
        "cautions": pair.cautions,
        "replay": merged.replay,
        "figure": all("poses.parquet" in a.found.files for a in (pair.before, pair.after)),
        "used": {"before": old.used, "after": new.used},
        "norm_source": next((p.norm.source for p in drawn if p.norm is not None), None),
        "at_speed": any(p.comfortable is not None for p in drawn),
        "norm_note": new.norm_note,
        "quality": {"before": old.quality, "after": new.quality},
    }


def _pairs(rows: Sequence[ComparedRow]) -> list[tuple[ComparedRow, int]]:
    """Rows with the number of rows that share their title on the first of them, 0 on the others."""
    names = [r.change.name for r in rows]
    return [
        (r, names.count(name) if names.index(name) == i else 0)
        for i, (r, name) in enumerate(zip(rows, names, strict=True))
    ]


def _gone(earlier: CurvePanel) -> bool:
    return earlier.reason is not None
