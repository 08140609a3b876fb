"""Trend on the first printed page: speed and score over comparable visits, in three lines."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from sagittal.core.frames import Side
from sagittal.core.parameters.catalogue import require_entries
from sagittal.server.report.charts.svg import KEY, format_coordinate
from sagittal.server.report.history.trends import (
    AnalysedVisit,
    Trend,
    TrendSeries,
    collect_figures,
    follow_figures,
)
from sagittal.server.report.words.change_words import SCORE_TERMS, ChangeWords, change_words, format_limit
from sagittal.server.report.words.wording import Term, format_number, reason_words

FIGURES: Final = ("gait_speed_mps", "gps_sagittal_deg", "step_length_m")
"""In this order as long as their lines fit into `MOST_LINES`; step length if there is no score."""

require_entries((name for name in FIGURES if name not in SCORE_TERMS), "server.report.history.trend_strip")

MOST_LINES: Final = 3
LEAST_VISITS: Final = 3
"""For two visits the table of values already shows the change."""

MOST_COLUMNS: Final = 5
"""The first visit and the last ones; the line includes all."""

WIDTH, HEIGHT, ROOM = 74, 15, 4
"""Of the line in px, and margin at both ends."""


@dataclass(frozen=True)
class TrendStripLine:
    """One side of a parameter, or the whole trial.

    Parameters
    ----------
    values : as printed, one per displayed visit; "–" if missing. estimated : mask of estimated values.
    change : of the last visit since `since`, None if either has no value. limit : its measurement error
        (MDC), "" if unknown. why_none : reason for a missing change, "" if there is one or the last visit has
        no value. since : date of the base visit, None = the first one.
    """

    title: str
    unit: str
    side: Side | None
    values: tuple[str, ...]
    estimated: tuple[bool, ...]
    svg: str
    change: ChangeWords | None
    limit: str
    why_none: str
    since: dt.date | None


@dataclass(frozen=True)
class TrendStrip:
    """The lines over the displayed visits.

    Parameters
    ----------
    days : of the displayed visits, oldest first. hidden : number of omitted visits between the first two.
    missing : date and reason of each missing value, without repetition.
    later : title and date for changes since a later visit than the first, whose value is missing, estimated
        or from a training.
    """

    days: tuple[dt.date, ...]
    hidden: int
    lines: tuple[TrendStripLine, ...]
    missing: tuple[tuple[dt.date, str], ...]
    later: tuple[tuple[str, dt.date], ...]


def trend_strip(visits: Sequence[AnalysedVisit], affected: Side | None = None) -> TrendStrip | None:
    """Trend of speed and score up to the last of these visits; None for fewer than three.

    Parameters
    ----------
    visits : under the same condition, oldest first. affected : side, None = none or both.
    """
    if len(visits) < LEAST_VISITS:
        return None
    chosen: list[tuple[Trend, TrendSeries]] = []
    for trend in follow_figures(visits, FIGURES, affected=affected):
        if len(chosen) + len(trend.lines) <= MOST_LINES:
            chosen += [(trend, line) for line in trend.lines]
    if not chosen:
        return None
    hidden = max(0, len(visits) - MOST_COLUMNS)
    indices = [0, *range(1 + hidden, len(visits))]
    missing = {
        (visits[i].performed_on, _explain(visits[i], trend.name, line.side))
        for trend, line in chosen
        for i in set(indices).difference(p.visit for p in line.points)
    }
    lines = tuple(_write_line(trend.term, line, visits, indices) for trend, line in chosen)
    later = dict.fromkeys((line.title, line.since) for line in lines if line.since is not None)
    days = tuple(visits[i].performed_on for i in indices)
    return TrendStrip(days, hidden, lines, tuple(sorted(missing)), tuple(later))


def _write_line(
    term: Term, line: TrendSeries, visits: Sequence[AnalysedVisit], indices: Sequence[int]
) -> TrendStripLine:
    points = {p.visit: p for p in line.points}
    last = points.get(len(visits) - 1)
    base = None if line.base is None else line.points[line.base].visit
    change = None if last is None else last.change
    return TrendStripLine(
        term.label,
        term.unit,
        line.side,
        tuple(format_number(points[i].value, term.digits) if i in points else "–" for i in indices),
        tuple(i in points and points[i].estimated for i in indices),
        _draw_line(line, visits),
        None if change is None else change_words(change),
        "" if change is None or change.limit is None else format_limit(change.limit, term),
        _explain_none(line, visits),
        None if not base or change is None else visits[base].performed_on,
    )


def _explain_none(line: TrendSeries, visits: Sequence[AnalysedVisit]) -> str:
    last = line.points[-1]
    if last.change is not None or last.visit != len(visits) - 1:
        return ""
    if line.base is None:
        return "not compared: only trainings, no assessment"
    if visits[-1].feedback:
        return "not compared: walked with feedback"
    return "first value to compare with"


def _explain(visit: AnalysedVisit, name: str, side: Side | None) -> str:
    matching = (p for p in collect_figures(visit.numbers) if (p.name, p.side) == (name, side))
    return reason_words(next((p.reason for p in matching), None))


def _draw_line(line: TrendSeries, visits: Sequence[AnalysedVisit]) -> str:
    """A small line over the dates of all visits, with the measurement error of its base as a band."""
    first = visits[0].performed_on
    days = max(1, (visits[-1].performed_on - first).days)
    band = () if line.mdc is None else (line.start - line.mdc, line.start + line.mdc)
    values = [*(p.value for p in line.points), *band]
    low, high = min(values), max(values)
    span = high - low or 1.0

    def x(visit: int) -> str:
        share = (visits[visit].performed_on - first).days / days
        return format_coordinate(ROOM + (WIDTH - 2 * ROOM) * share)

    def y(value: float) -> str:
        return format_coordinate(HEIGHT - ROOM - (HEIGHT - 2 * ROOM) * (value - low) / span)

    key = "b" if line.side is None else KEY[line.side]
    shapes = []
    if band:
        tall = format_coordinate(float(y(band[0])) - float(y(band[1])))
        shapes.append(f'<rect class="mdc" x="0" width="{WIDTH}" y="{y(band[1])}" height="{tall}"/>')
    # estimated values are not connected with measured ones
    joined = [p for p in line.points if not p.estimated] or line.points
    shapes += [
        f'<path class="tr-{key}" d="M{x(a.visit)} {y(a.value)}L{x(b.visit)} {y(b.value)}"/>'
        for a, b in pairwise(joined)
    ]
    for p in line.points:
        css = f"ps-{key}"
        css += " est" if p.estimated else ""
        shapes.append(f'<circle class="{css}" cx="{x(p.visit)}" cy="{y(p.value)}" r="1.8"/>')
    return (
        f'<svg class="chart" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'aria-hidden="true">{"".join(shapes)}</svg>'
    )
