"""Chart of one side of a trend: assessments large, trainings small, the measurement error as a band.

Follows the conventions of the cycle curves (server/report/charts/svg.py): the plot stretches, text and
strokes do not, colours are set by CSS classes.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from sagittal.core.message import Message
from sagittal.server.report.charts.svg import KEY, PlotArea, find_round_ticks, format_coordinate
from sagittal.server.report.history.trends import AnalysedVisit, Trend, TrendSeries
from sagittal.server.report.words.wording import format_number
from sagittal.web.message_format import MONTHS

TOP, BOTTOM, LEFT, RIGHT = 22, 22, 44, 12
"""Margins in px, the padding of `<div class="chart trend-plot">`."""

ROOM: Final = 0.06
"""Fraction of the time axis left free at both ends."""

LABEL_PX: Final = 46
"""Width of a label under the axis."""

WIDTH_PX: Final = 420
"""Minimum width of a chart for reading; labels that would touch at this width are omitted."""
SMALL_PX: Final = 170
"""Likewise for five adjacent charts."""


@dataclass(frozen=True)
class PlannedAssessment:
    """An upcoming planned assessment."""

    label: str
    day: dt.date


def value_range(trend: Trend) -> tuple[float, float]:
    """Limits of the value axis for both sides: values, bands and norm with a margin."""
    values: list[float] = []
    for line in trend.lines:
        values += [p.value for p in line.points]
        for size in (line.mdc, line.mcid):
            values += [] if size is None else [line.start - size, line.start + size]
    if trend.norm is not None:
        values += [trend.norm.mean - trend.norm.sd, trend.norm.mean + trend.norm.sd]
    low, high = min(values), max(values)
    room = 0.08 * (high - low) or 0.5 * abs(high) or 1.0
    return low - room, high + room


def trend_svg(
    trend: Trend,
    line: TrendSeries,
    visits: Sequence[AnalysedVisit],
    ahead: Sequence[PlannedAssessment] = (),
    height: int = 196,
    *,
    small: bool = False,
) -> str:
    """Draw one side of a trend over the dates of all visits, so that all charts of a patient share an axis.

    Parameters
    ----------
    ahead : upcoming planned assessments, drawn as labelled hairlines. height : px including margins.
    small : for small multiples, without grid and without labels of band and limit.
    """
    plot = _TrendPlot(
        value_range(trend), visits, ahead, height - TOP - BOTTOM, SMALL_PX if small else WIDTH_PX
    )
    base = line.start
    if trend.norm is not None:
        plot.add_band("band", trend.norm.mean - trend.norm.sd, trend.norm.mean + trend.norm.sd)
    if line.mdc is not None:
        plot.add_band("mdc", base - line.mdc, base + line.mdc)
    ticks, digits = find_round_ticks(plot.low, plot.high)
    for tick in () if small else ticks:
        plot.add_tick("g", tick, format_number(tick, digits))
    if trend.norm is not None:
        plot.add_level("nm", trend.norm.mean)
    if line.mdc is not None:
        plot.add_level("mdcl", base - line.mdc)
        plot.add_level("mdcl", base + line.mdc)
    if line.mcid is not None:
        plot.add_level("mcid", base - line.mcid)
        plot.add_level("mcid", base + line.mcid)
    plot.days()
    if not small:
        plot.labels(line)
    plot.points(line, trend.term.digits)
    title = f"{trend.term.label}{'' if line.side is None else f', {line.side}'}"
    return plot.draw(
        "chart trend-plot small" if small else "chart trend-plot",
        Message("{title} by visit; values in the table", title=title),
    )


class _TrendPlot(PlotArea):
    """A plot over the dates of visits."""

    def __init__(
        self,
        y_range: tuple[float, float],
        visits: Sequence[AnalysedVisit],
        ahead: Sequence[PlannedAssessment],
        height: int,
        width: int,
    ) -> None:
        super().__init__(y_range, height)
        self._width = width
        self._visits, self._ahead = visits, ahead
        days = [v.performed_on for v in visits] + [a.day for a in ahead]
        self._first = min(days)
        span = (max(days) - self._first).days
        self._span = float(span) if span else 1.0
        self._alone = span == 0

    def days(self) -> None:
        """Hairlines of planned visits, and labels below the axis: assessments first, then trainings."""
        labels = [(v.performed_on, v.label or _day(v.performed_on), "words") for v in self._visits
                  if v.kind == "assessment"]  # fmt: skip
        labels += [(a.day, a.label, "") for a in self._ahead]
        labels.sort(key=lambda w: (w[0] != self._visits[0].performed_on, w[0]))
        placed: list[float] = []
        for day, label, css in labels:
            x = self._x(day)
            if all(abs(x - position) * self._width / 1000 >= LABEL_PX for position in placed):
                placed.append(x)
                self.add_text(_pct(x), self.height, label, css, "middle", dy=15)
        for planned in self._ahead:
            self.add_upright("ax", self._x(planned.day))

    def points(self, line: TrendSeries, digits: int) -> None:
        key = "b" if line.side is None else KEY[line.side]
        assessed = [p for p in line.points if self._visits[p.visit].kind == "assessment"]
        # estimated values are not connected with measured ones
        for a, b in pairwise([p for p in assessed if not p.estimated] or assessed):
            ends = (self._at(a.visit), a.value), (self._at(b.visit), b.value)
            d = "L".join(f"{format_coordinate(x)} {format_coordinate(self.y(value))}" for x, value in ends)
            self.add(f'<path class="tr-{key}" d="M{d}"/>')
        for p in line.points:
            large = self._visits[p.visit].kind == "assessment"
            css, radius = (f"pl-{key}", 5.0) if large else (f"ps-{key}", 2.8)
            css += " est" if p.estimated else ""
            self.add_dot(self._at(p.visit), p.value, css, radius)
        for i in sorted({i for i in (line.base, line.latest) if i is not None}):
            p = line.points[i]
            x, y = _pct(self._at(p.visit)), self.px(p.value)
            self.add_text(x, y, format_number(p.value, digits), "strong halo", "middle", dy=-11)

    def labels(self, line: TrendSeries) -> None:
        """Label band and limit where there are no data, otherwise in the middle, away from the two values."""
        base = line.start
        last = max(v.performed_on for v in self._visits)
        free = self._alone or any(a.day > last for a in self._ahead)
        x, anchor, dx = ("100%", "end", -4) if free else ("50%", "middle", 0)
        if line.mdc is not None:
            y = self.px(base - line.mdc)
            self.add_text(x, y, "within measurement error (MDC)", "words halo", anchor, dx=dx, dy=-5)
        if line.mcid is not None and line.mcid != line.mdc:
            y = self.px(base + line.mcid)
            self.add_text(x, y, "MCID", "words halo", anchor, dx=dx, dy=-4)

    def _at(self, visit: int) -> float:
        return self._x(self._visits[visit].performed_on)

    def _x(self, day: dt.date) -> float:
        if self._alone:
            return 500.0
        return 1000 * (ROOM + (1 - 2 * ROOM) * (day - self._first).days / self._span)


def _day(day: dt.date) -> str:
    return f"{day.day} {MONTHS[day.month - 1]}"


def _pct(x: float) -> str:
    return f"{format_coordinate(x / 10)}%"
