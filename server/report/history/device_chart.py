"""Charts of a sensor's checks over time, following the conventions of trends (trend_chart.py)."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from typing import Final

from sagittal.core.message import Message
from sagittal.server.report.charts.svg import PlotArea, find_round_ticks, format_coordinate
from sagittal.server.report.history.trend_chart import BOTTOM, LABEL_PX, ROOM, TOP, WIDTH_PX
from sagittal.server.report.words.wording import format_number
from sagittal.web.message_format import MONTHS

HEIGHT: Final = 168
"""px including margins."""


def draw_device(
    title: str,
    days: Sequence[dt.date],
    values: Sequence[float | None],
    *,
    digits: int,
    least: float,
    band: tuple[float, float] | None = None,
) -> str | None:
    """Draw a quantity of a sensor over the dates of its trials; None if it was never measured.

    Parameters
    ----------
    least : minimum range of the value axis, so that noise does not look like a change.
    band : range of values that are not a change.
    """
    plotted_points = [(x, v) for x, v in zip(_places(days), values, strict=True) if v is not None]
    if not plotted_points:
        return None
    plotted = [*(v for _, v in plotted_points), *(band or ())]
    low, high = min(plotted), max(plotted)
    room = max(0.08 * (high - low), (least - (high - low)) / 2)
    plot = PlotArea((low - room, high + room), HEIGHT - TOP - BOTTOM)
    if band is not None:
        plot.add_band("mdc", *band)
    ticks, places = find_round_ticks(plot.low, plot.high)
    for tick in ticks:
        plot.add_tick("g", tick, format_number(tick, places))
    _name_days(plot, days)
    points = "L".join(f"{format_coordinate(x)} {format_coordinate(plot.y(v))}" for x, v in plotted_points)
    plot.add(f'<path class="tr-b" d="M{points}"/>')
    for x, v in plotted_points[:-1]:
        plot.add_dot(x, v, "ps-b", 2.8)
    x, v = plotted_points[-1]
    plot.add_dot(x, v, "pl-b", 5.0)
    x_text, text = f"{format_coordinate(x / 10)}%", format_number(v, digits)
    plot.add_text(x_text, plot.px(v), text, "strong halo", "middle", dy=-11)
    return plot.draw("chart trend-plot", Message("{title} by trial; values in the table", title=title))


def _name_days(plot: PlotArea, days: Sequence[dt.date]) -> None:
    """Dates below the axis, giving priority to the first and last."""
    positions = _places(days)
    placed: list[float] = []
    for i in (0, len(days) - 1, *range(1, len(days) - 1)):
        if all(abs(positions[i] - position) * WIDTH_PX / 1000 >= LABEL_PX for position in placed):
            placed.append(positions[i])
            label = f"{days[i].day} {MONTHS[days[i].month - 1]}"
            plot.add_text(
                f"{format_coordinate(positions[i] / 10)}%", plot.height, label, "words", "middle", dy=15
            )


def _places(days: Sequence[dt.date]) -> list[float]:
    """Positions of trials on the axis, 0 to 1000; trials of one day are placed side by side."""
    span = (days[-1] - days[0]).days
    if span == 0:
        n = len(days)
        return [1000 * (ROOM + (1 - 2 * ROOM) * (i + 0.5) / n) for i in range(n)]
    return [1000 * (ROOM + (1 - 2 * ROOM) * (d - days[0]).days / span) for d in days]
