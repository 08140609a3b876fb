"""What pages about several visits of a patient show, as plain values for the templates."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from server.report.change_words import change_words, term_of
from server.report.comparison import ComparedRow
from server.report.curves import cycle_svg
from server.report.notes import GROUPS
from server.report.panels import CurvePanel, same_zero
from server.report.trend_chart import Ahead, trend_svg
from server.report.trends import PRIMARY, Line, Trend, Visit, names_in, trends
from server.report.wording import number
from server.services import comparisons, reports
from server.services.comparisons import Pair
from server.services.histories import History
from server.services.programmes import PlannedVisit, Programme
from server.session_views import COLUMNS, PAGE_HEIGHTS, SECONDARY, chart_view
from server.storage.blobs import BlobStore
from web.words import day

TEASERS: Final = ("gait_speed_mps", "step_length_m", "knee_flexion_rom_deg", "stride_time_s")
"""On the patient's page: the first of these that was measured."""

STATE_WORDS: Final[Mapping[str, tuple[str, str]]] = {
    "done": ("ok", "Done"),
    "missing": ("warn", "Missing"),
    "next": ("run", "Next"),
    "planned": ("none", "Planned"),
}
"""State of a planned visit → shape and word."""


def programme_view(programme: Programme, today: dt.date) -> dict[str, Any]:
    """A programme as a strip of weeks and a list."""
    now_week = (today - programme.starts_on).days // 7 + 1
    weeks = range(min(v.week for v in programme.visits), max(v.week for v in programme.visits) + 1)
    upcoming = programme.next
    said = [f"{programme.count('done')} of {len(programme.visits)} visits done"]
    if missing := programme.count("missing"):
        said.append(f"{missing} missing")
    if upcoming is not None:
        said.append(f"next {upcoming.label} on {day(upcoming.planned_on)}")
    return {
        "id": programme.id,
        "starts_on": programme.starts_on,
        "words": programme.words,
        "summary": ", ".join(said),
        "weeks": [_week(programme, week, now=week == now_week) for week in weeks],
        "visits": [_planned(v) for v in programme.visits],
    }


def _week(programme: Programme, week: int, *, now: bool) -> dict[str, Any]:
    mine = [v for v in programme.visits if v.week == week]
    trainings = [v for v in mine if v.kind == "training"]
    done = sum(v.state == "done" for v in trainings)
    missing = sum(v.state == "missing" for v in trainings)
    said = f"{done} of {len(trainings)} trainings done" + (f", {missing} missing" if missing else "")
    # the course counts weeks without a week 0: the one before the first training is −1
    return {
        "name": "now" if now else f"wk {number(week if week > 0 else week - 1)}",
        "now": now,
        "gap": not mine,
        "assessments": [v for v in mine if v.kind == "assessment"],
        "trainings": trainings,
        "words": said,
    }


def _planned(v: PlannedVisit) -> dict[str, Any]:
    shape, word = STATE_WORDS[v.state]
    return {**vars(v), "shape": shape, "word": word}


def ahead(history: History) -> list[Ahead]:
    """Assessments of the newest programme that are still to come."""
    plans = history.programmes[:1]
    return [
        Ahead(v.label, v.planned_on)
        for plan in plans
        for v in plan.visits
        if v.kind == "assessment" and v.state in {"next", "planned"}
    ]


def teaser(history: History) -> dict[str, Any] | None:
    """The first figure of the trends, once there is something to compare."""
    there = [n for n in names_in(history.visits) if n in TEASERS]
    if len(history.visits) < 2 or not there:
        return None
    name = min(there, key=TEASERS.index)
    found = trends(history.visits, [name], history.norms, history.usual, history.patient.affected_side)
    return _shown(history, found, height=168)


def trends_view(history: History, chosen: Sequence[str]) -> dict[str, Any]:
    """The trends page: charts of the chosen figures, the choice, limits with sources, and the table."""
    there = names_in(history.visits)
    names = [n for n in there if n in chosen] or [n for n in PRIMARY if n in there]
    found = trends(history.visits, names, history.norms, history.usual, history.patient.affected_side)
    groups: dict[str, list[dict[str, Any]]] = {}
    for name in there:
        term = term_of(name)
        groups.setdefault(term.group, []).append(
            {"name": name, "title": term.label, "unit": term.unit, "on": name in names}
        )
    return {
        **_shown(history, found, height=196),
        "groups": list(groups.items()),
        "query": "&".join(f"show={name}" for name in names),
        "condition": None if history.condition is None else history.condition.words,
        "like": history.visits[-1].session_id if history.visits else None,
        "others": [(o.session_id, o.condition.words, o.count) for o in history.others],
        "visits": [_column(v) for v in history.visits],
        "rows": [row for trend in found for row in _rows(trend, history.visits)],
    }


def comparison_view(blobs: BlobStore, found: Pair) -> dict[str, Any]:
    """The comparison page: charts with the earlier means behind, the table under its headings, sources."""
    rows = comparisons.rows(blobs, found)
    _, old = reports.read(blobs, found.before.found, found.before.edits, found.patient, found.before.session)
    _, new = reports.read(blobs, found.after.found, found.after.edits, found.patient, found.after.session)
    last_row = len(new.panels) - COLUMNS
    charts, drawn = [], []
    for i, (before, after) in enumerate(zip(old.panels, new.panels, strict=True)):
        below = i >= last_row
        earlier, panel = same_zero(before, after)
        svg = cycle_svg(
            panel, height=PAGE_HEIGHTS[below], x_unit=below, single_strides=False, earlier=earlier
        )
        charts.append({**chart_view(panel, svg), "gone": _gone(earlier)})
        drawn.append(panel)
    shown = replace(new, panels=tuple(drawn))
    groups: dict[str, list[ComparedRow]] = {}
    for row in rows:
        groups.setdefault(row.group, []).append(row)
    sources: dict[str, list[str]] = {}
    for row in rows:
        for sentence in row.words.limits:
            sources.setdefault(sentence, []).append(row.title)
    judged = [r for r in rows if r.words.mark in {"up", "down"}]
    return {
        "charts": charts,
        "groups": [(name, _pairs(mine)) for name, mine in groups.items() if name not in SECONDARY],
        "more": [(name, _pairs(mine)) for name, mine in groups.items() if name in SECONDARY],
        "limits": [(", ".join(dict.fromkeys(titles)), s) for s, titles in sources.items()],
        "real": judged,
        "comparable": found.comparable,
        "cautions": found.cautions,
        "replay": shown.replay,
        "figure": all("poses.parquet" in a.found.files for a in (found.before, found.after)),
        "used": {"before": old.used, "after": new.used},
        "norm_source": next((p.norm.source for p in drawn if p.norm is not None), None),
        "norm_note": new.norm_note,
        "quality": {"before": old.quality, "after": new.quality},
    }


def _pairs(rows: Sequence[ComparedRow]) -> list[tuple[ComparedRow, int]]:
    """Rows with how many share their title: the number on the first of them, 0 on the others."""
    names = [r.change.name for r in rows]
    return [
        (r, names.count(name) if names.index(name) == i else 0)
        for i, (r, name) in enumerate(zip(rows, names, strict=True))
    ]


def _gone(earlier: CurvePanel) -> bool:
    return earlier.reason is not None


def _shown(history: History, found: Sequence[Trend], height: int) -> dict[str, Any]:
    coming = ahead(history)
    lines = [(t, line) for t in found for line in t.lines]
    sources: dict[str, list[str]] = {}
    for t, line in lines:
        change = line.change
        for sentence in () if change is None else change_words(change).limits:
            sources.setdefault(sentence, []).append(t.term.label)
    norms: dict[str, list[str]] = {}
    for t in found:
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
        "has_training": any(v.kind == "training" for v in history.visits),
    }


def _figure(
    trend: Trend, line: Line, visits: Sequence[Visit], coming: Sequence[Ahead], height: int
) -> dict[str, Any]:
    change = line.change
    base = None if line.base is None else visits[line.points[line.base].visit]
    return {
        "title": trend.term.label,
        "unit": trend.term.unit,
        "side": line.side,
        "svg": trend_svg(trend, line, visits, coming, height),
        "words": None if change is None else change_words(change),
        "since": None if base is None else base.label or day(base.performed_on),
        "waiting": _waiting(line),
    }


def _waiting(line: Line) -> str:
    """What is said as long as there are not two assessments."""
    return "no assessment yet" if line.base is None else "one assessment so far"


def _column(v: Visit) -> dict[str, Any]:
    return {
        "href": f"/sessions/{v.session_id}",
        "label": v.label,
        "day": v.performed_on,
        "training": None if v.kind == "assessment" else "with feedback" if v.feedback else "training",
    }


def _rows(trend: Trend, visits: Sequence[Visit]) -> list[dict[str, Any]]:
    """A row per side: the value of every visit, then the verdict."""
    rows = []
    for line in trend.lines:
        by_visit = {p.visit: p for p in line.points}
        cells = []
        for i in range(len(visits)):
            p = by_visit.get(i)
            mark = "" if p is None or p.change is None else change_words(p.change).mark
            text = None if p is None else number(p.value, trend.term.digits)
            cells.append({"text": text, "mark": mark})
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
