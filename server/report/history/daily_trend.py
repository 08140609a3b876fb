"""Capacity in the clinic and performance at home, over the same period.

Capacity is the walk of a clinic session (gait speed, cadence); performance is daily life (steps per day,
cadence of longer bouts). They are different quantities with separate axes; cadence shares one.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.activity.parameters import WORN_H
from sagittal.core.activity.result import ActivityResult
from sagittal.core.message import Message
from sagittal.core.parameters.result import Parameter
from sagittal.server.report.charts.svg import PlotArea, find_round_ticks, format_coordinate
from sagittal.server.report.words.wording import format_number
from sagittal.web.message_format import MONTHS

LONG_BOUT_S: Final = 60.0
"""Minimum duration of walking bouts at home for comparing cadence: short ones include turns and stops."""

PANEL_PX: Final = 96
ROOM: Final = 0.06
"""Fraction of the time axis left free at both ends."""

LABEL_SHARE: Final = 0.13
"""Minimum distance of labels under the axis, as a fraction of its width."""


@dataclass(frozen=True)
class CapacityVisit:
    """A walk in the clinic; unmeasured values are None."""

    session_id: str
    day: dt.date
    title: str
    speed_mps: float | None
    cadence_spm: float | None


@dataclass(frozen=True)
class PerformanceDay:
    """A day of daily life.

    Parameters
    ----------
    day : by the device's clock, otherwise counted from the date of the session.
    cadence_spm : median of the walking bouts of at least LONG_BOUT_S, None without any.
    """

    session_id: str
    day: dt.date
    steps: int
    worn_h: float
    cadence_spm: float | None

    @property
    def counted(self) -> bool:
        """Whether wear time is sufficient for comparison."""
        return self.worn_h >= WORN_H


@dataclass(frozen=True)
class TrendPanel:
    """One chart."""

    title: str
    unit: str
    svg: str


def read_capacity(
    session_id: str, day: dt.date, title: str, parameters: Sequence[Parameter]
) -> CapacityVisit | None:
    """Speed and cadence of a clinic walk; None if neither was measured."""
    means = {p.name: p.mean for p in parameters if p.side is None}
    speed, cadence = means.get("gait_speed_mps"), means.get("cadence_spm")
    if speed is None and cadence is None:
        return None
    return CapacityVisit(session_id, day, title, speed, cadence)


def read_performance(
    session_id: str, performed_on: dt.date, activity: ActivityResult
) -> list[PerformanceDay]:
    """Days of a daily-life recording with any wear time."""
    days = []
    for i, d in enumerate(activity.days):
        own = [
            b.cadence_spm
            for b in activity.bouts
            if d.start_s <= b.start_s < d.end_s and b.kind == "walking" and b.duration_s >= LONG_BOUT_S
        ]
        if d.worn_h > 0.0:
            date = d.date or performed_on + dt.timedelta(days=i)
            cadence = float(np.median(own)) if own else None
            days.append(PerformanceDay(session_id, date, d.steps, d.worn_h, cadence))
    return days


def draw_daily_trend(
    capacity: Sequence[CapacityVisit], performance: Sequence[PerformanceDay]
) -> tuple[TrendPanel, ...]:
    """Draw capacity and performance on one time axis; empty without daily-life recordings.

    Clinic: discs. Home: bars and rings, dashed if the wear time is insufficient.
    """
    if not performance:
        return ()
    days = [*(v.day for v in capacity), *(d.day for d in performance)]
    span = (min(days), max(days))
    speed = [(v.day, v.speed_mps) for v in capacity if v.speed_mps is not None]
    clinic = [(v.day, v.cadence_spm) for v in capacity if v.cadence_spm is not None]
    home = [(d.day, d.cadence_spm, d.counted) for d in performance if d.cadence_spm is not None]
    panels = []
    if speed:
        plot = _TimePanel(span, _range([x for _, x in speed]))
        plot.add_line([*speed])
        panels.append(TrendPanel("Capacity: gait speed in the clinic", "m/s", plot.finish("Gait speed")))
    steps = _TimePanel(span, (0.0, 1.1 * max(d.steps for d in performance) or 1.0))
    for d in performance:
        steps.add_day_bar(d.day, float(d.steps), full=d.counted)
    panels.append(TrendPanel("Performance: steps per day at home", "", steps.finish("Steps per day")))
    if clinic or home:
        plot = _TimePanel(span, _range([x for _, x in clinic] + [x for _, x, _ in home]))
        plot.add_line(clinic)
        for day, value, is_counted in home:
            plot.add_dot(plot.x(day), value, "ak-ring" if is_counted else "ak-ring part", 4.0)
        panels.append(TrendPanel("Cadence: clinic and walks at home", "steps/min", plot.finish("Cadence")))
    return tuple(panels)


def _range(values: Sequence[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    room = 0.15 * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room


class _TimePanel(PlotArea):
    """A plot over days."""

    def __init__(self, span: tuple[dt.date, dt.date], y_range: tuple[float, float]) -> None:
        super().__init__(y_range, PANEL_PX)
        self._first, self._days = span[0], (span[1] - span[0]).days
        self._labelled = span
        ticks, digits = find_round_ticks(self.low, self.high)
        for tick in ticks[:: 2 if len(ticks) > 4 else 1]:
            self.add_tick("g", tick, format_number(tick, digits))

    def x(self, day: dt.date) -> float:
        """Horizontal position of a day, 0 to 1000."""
        if not self._days:
            return 500.0
        return 1000 * (ROOM + (1 - 2 * ROOM) * (day - self._first).days / self._days)

    def add_line(self, points: Sequence[tuple[dt.date, float]]) -> None:
        """Add discs and their connecting line."""
        d = "L".join(f"{format_coordinate(self.x(day))} {format_coordinate(self.y(v))}" for day, v in points)
        if len(points) > 1:
            self.add(f'<path class="tr-b" d="M{d}"/>')
        for day, value in points:
            self.add_dot(self.x(day), value, "pl-b", 5.0)

    def add_day_bar(self, day: dt.date, value: float, *, full: bool) -> None:
        """Add the bar of a day, with the width of the day but at least visible."""
        wide = max(6.0, 0.7 * 1000 * (1 - 2 * ROOM) / max(self._days, 8))
        self.add_band("bar" if full else "bar part", 0.0, value, self.x(day) - wide / 2, wide)

    def finish(self, title: str) -> str:
        """Add dates below the axis and return the chart."""
        step = max(1, math.ceil(self._days * LABEL_SHARE))
        ends = range(0, self._days + 1, step) if self._days else (0,)
        for days in ends:
            day = self._first + dt.timedelta(days=days)
            label = f"{day.day} {MONTHS[day.month - 1]}"
            self.add_text(f"{format_coordinate(self.x(day) / 10)}%", self.height, label, "", "middle", dy=15)
        return self.draw("chart trend-plot", Message("{title} over time; values in the table", title=title))
