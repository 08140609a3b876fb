"""Charts of a comparison of filters: spread over the gait cycle or over time, and Bland–Altman plots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, Literal

import numpy as np

from sagittal.core.frames import Floats, Side
from sagittal.core.message import Message
from sagittal.core.signals.rest import find_runs
from sagittal.server.report.charts.curves import X_TICKS
from sagittal.server.report.charts.svg import (
    KEY,
    PlotArea,
    find_round_ticks,
    format_coordinate,
    make_time_labels,
)
from sagittal.server.report.words.wording import format_number

Over = Literal["cycle", "time"]

HEIGHT: Final = 132
TOP, BOTTOM = 18, 20
"""Margins in px, as the stylesheet has them for `.chart.cycle`."""
AGREEMENT_HEIGHT: Final = 240


def draw_spread(title: str, lines: Mapping[Side | None, Floats], top: float, end: float, over: Over) -> str:
    """Draw the standard deviation between filters in degrees, by side, or (None) for both.

    Parameters
    ----------
    top : upper limit of the value axis, shared by adjacent charts. end : of the time axis in s, or 100 %.
    """
    plot = PlotArea((0.0, top), HEIGHT - TOP - BOTTOM)
    ticks, digits = find_round_ticks(0.0, top)
    for tick in ticks:
        plot.add_tick("z" if tick == 0 else "g", tick, f"{format_number(tick, digits)}°")
    for side, values in lines.items():
        plot.add(f'<path class="m{"b" if side is None else KEY[side]}" d="{_path(plot, values)}"/>')
    if over == "cycle":
        for tick in X_TICKS:
            plot.add_text(f"{tick}%", plot.height, str(tick), "", "middle", dy=15)
    else:
        plot.add_fixed(make_time_labels(end, plot.height, 15))
    axis = "the gait cycle" if over == "cycle" else "time"
    return plot.draw(
        "chart cycle",
        Message("{title}: standard deviation between the filters over {axis}", title=title, axis=axis),
    )


def _path(plot: PlotArea, values: Floats) -> str:
    """A curve over the full width, interrupted where it has no value."""
    x = np.linspace(0.0, 1000.0, len(values))
    return "".join(
        "M"
        + "L".join(f"{format_coordinate(x[i])} {format_coordinate(plot.y(values[i]))}" for i in range(a, b))
        for a, b in find_runs(np.isfinite(values))
    )


def draw_agreement(
    title: str, middle: Sequence[float], difference: Sequence[float], levels: Sequence[float]
) -> str:
    """Draw a Bland–Altman plot in degrees: difference over mean, with bias and limits of agreement as lines.

    Parameters
    ----------
    levels : bias, lower and upper limit of agreement.
    """
    ends = [*difference, *levels, 0.0]
    room = 0.08 * (max(ends) - min(ends)) or 1.0
    plot = PlotArea((min(ends) - room, max(ends) + room), AGREEMENT_HEIGHT - TOP - 34)
    ticks, digits = find_round_ticks(plot.low, plot.high)
    for tick in ticks:
        plot.add_tick("z" if tick == 0 else "g", tick, f"{format_number(tick, digits)}°")
    left, right = min(middle), max(middle)
    width = right - left or 1.0
    left, right = left - 0.03 * width, right + 0.03 * width
    for a, d in zip(middle, difference, strict=True):
        plot.add_dot(1000.0 * (a - left) / (right - left), d, "ba", 2.2)
    for value, css, word in zip(
        levels, ("bal", "mdcl", "mdcl"), ("bias", "−1.96 SD", "+1.96 SD"), strict=True
    ):
        plot.add_level(css, value)
        label = f"{word} {format_number(value, 1)}°"
        plot.add_text("100%", plot.px(value), label, "words halo", "end", dx=-4, dy=-4)
    marks, digits = find_round_ticks(left, right)
    for mark in marks:
        x = f"{format_coordinate(100.0 * (mark - left) / (right - left))}%"
        plot.add_text(x, plot.height, f"{format_number(mark, digits)}°", "", "middle", dy=15)
    plot.add_text("100%", plot.height, "mean of filter and reference", "", "end", dy=30)
    plot.add_text("0", 0, "Filter more ↑", "words halo", "start", dx=5, dy=11)
    return plot.draw(
        "chart cycle x-unit",
        Message(
            "{title}: difference (filter − reference) against their mean; values in the table", title=title
        ),
    )
