"""Common elements of charts: plot area, axes, text and dots, and the bar of a table row.

The margins of a chart are the padding of its `<div>`; the `<svg>` is the plot area. Data are drawn in a
nested `viewBox="0 0 1000 1000"` that stretches, while strokes and text keep their size; labels are placed in
percent and px. Colours, widths and dashes are set by CSS classes only (design tokens), so light, dark and
print share one drawing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Final

from sagittal.core.frames import Side

KEY: Final[dict[Side, str]] = {"left": "l", "right": "r"}
"""Letter of a side in CSS classes."""

TICKS: Final = 5
"""Maximum number of ticks on a value axis."""
ROUNDING: Final = 1e-9
"""Tolerance as a fraction of a step, so that a multiple at the end of an axis gets its tick."""

BAR_MARKS: Final = (("right", "dr", 4.6), ("left", "dl", 5.2), ("both", "ptf", 5.0))
"""Marks of a bar from back to front: ring, disc, dark disc; CSS class and radius in px."""


def format_coordinate(value: float) -> str:
    """Format a coordinate in tenths, without ".0"."""
    return f"{value:.1f}".removesuffix(".0")


def make_label(x: str, y: float, text: str, css: str, anchor: str, dx: int = 0, dy: int = 0) -> str:
    """Create a label; `x` with its unit, "12%" or "0", other coordinates in px."""
    named = f' class="{css}"' if css else ""
    return (
        f'<text{named} x="{x}" y="{format_coordinate(y)}" dx="{dx}" dy="{dy}" text-anchor="{anchor}">'
        f"{escape(text)}</text>"
    )


def find_round_ticks(low: float, high: float) -> tuple[list[float], int]:
    """Return the multiples of 1, 2 or 5 · 10ⁿ on an axis, at most about TICKS, and the required decimals.

    `web/static/js/common/ticks.js` is the equivalent for browsers.
    """
    raw = (high - low) / TICKS
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(f * power for f in (1, 2, 5, 10) if f * power >= raw)
    first, last = math.ceil(low / step - ROUNDING), math.floor(high / step + ROUNDING)
    return [step * i for i in range(first, last + 1)], max(0, -math.floor(math.log10(step) + ROUNDING))


def make_time_labels(duration_s: float, y: float, dy: int) -> str:
    """Create the labels of a time axis from 0, at most a dozen up to two minutes."""
    step = next((s for s in (1, 2, 5, 10, 30, 60) if duration_s / s <= 12), 120)
    return "".join(
        make_label(f"{format_coordinate(100 * t / duration_s)}%", y, f"{t}\u2009s", "", "middle", dy=dy)
        for t in range(0, int(duration_s) + 1, step)
    )


def stretch(shapes: str) -> str:
    """Return shapes with coordinates 0 to 1000 stretched to the plot area."""
    return (
        '<svg viewBox="0 0 1000 1000" preserveAspectRatio="none" width="100%" height="100%" '
        f'overflow="hidden">{shapes}</svg>'
    )


def draw_bar(
    marks: Mapping[Side, float] | Mapping[str, float],
    boxes: Sequence[tuple[float, float]],
    middle: float | None,
    scale: tuple[float, float],
    width: int,
) -> str:
    """Draw the bar of a table row: norm ranges as boxes with their centre as a line, values as marks.

    Parameters
    ----------
    marks : "left", "right", "both" → value. boxes : low and high, the rear one first; values outside `scale`
        are drawn at its end. width : px.
    """

    def x(value: float) -> float:
        inside = (value - scale[0]) / (scale[1] - scale[0])
        return round(min(max(6 + (width - 12) * inside, 6), width - 6), 1)

    f = format_coordinate
    parts = [f'<line class="ax" x1="2" x2="{width - 2}" y1="13" y2="13"/>']
    for low, high in boxes:
        left = x(low)
        parts.append(
            f'<rect class="band" x="{f(left)}" y="5" width="{f(x(high) - left)}" height="16" rx="2"/>'
        )
    if middle is not None:
        parts.append(f'<line class="nm" x1="{f(x(middle))}" x2="{f(x(middle))}" y1="5" y2="21"/>')
    values = {str(name): value for name, value in marks.items()}
    for mark, css, radius in BAR_MARKS:
        if mark in values:
            parts.append(f'<circle class="{css}" cx="{f(x(values[mark]))}" cy="13" r="{radius}"/>')
    return (
        f'<svg class="chart range" width="{width}" height="26" viewBox="0 0 {width} 26" aria-hidden="true">'
        f"{''.join(parts)}</svg>"
    )


class PlotArea:
    """Collects stretching shapes (0 to 1000 both ways) and fixed ones (percent and px), from back to front.

    Parameters
    ----------
    y_range : values at the bottom and the top. height : px without margins.
    """

    def __init__(self, y_range: tuple[float, float], height: int) -> None:
        self.height = height
        self.low, self.high = y_range
        self._stretched: list[str] = []
        self._fixed: list[str] = []

    def y(self, value: float) -> float:
        """Vertical position of a value, 0 at the top to 1000."""
        return 1000 - 1000 * (value - self.low) / (self.high - self.low)

    def px(self, value: float) -> float:
        """Vertical position of a value in px from the top."""
        return self.y(value) / 1000 * self.height

    def add(self, shape: str) -> None:
        """Add a stretching shape."""
        self._stretched.append(shape)

    def add_level(self, css: str, value: float) -> None:
        """Add a horizontal line at a value."""
        y = format_coordinate(self.y(value))
        self.add(f'<line class="{css}" x1="0" x2="1000" y1="{y}" y2="{y}"/>')

    def add_upright(self, css: str, x: float) -> None:
        """Add a vertical line at 0 to 1000 of the width."""
        position = format_coordinate(x)
        self.add(f'<line class="{css}" x1="{position}" x2="{position}" y1="0" y2="1000"/>')

    def add_band(self, css: str, low: float, high: float, x: float = 0.0, width: float = 1000.0) -> None:
        """Add a band between two values, over all or part of the width."""
        top, bottom = self.y(high), self.y(low)
        f = format_coordinate
        self.add(
            f'<rect class="{css}" x="{f(x)}" width="{f(width)}" y="{f(top)}" height="{f(bottom - top)}"/>'
        )

    def add_column(self, css: str, x: float, width: float) -> None:
        """Add a column over the full height."""
        f = format_coordinate
        self.add(f'<rect class="{css}" x="{f(x)}" width="{f(width)}" y="0" height="1000"/>')

    def add_tick(self, css: str, value: float, label: str) -> None:
        """Add a grid line with its axis label."""
        self.add_level(css, value)
        self.add_text("0", self.px(value), label, "", "end", dx=-7, dy=4)

    def add_text(self, x: str, y: float, text: str, css: str, anchor: str, dx: int = 0, dy: int = 0) -> None:
        """Add a label, like `make_label`."""
        self._fixed.append(make_label(x, y, text, css, anchor, dx, dy))

    def add_fixed(self, labels: str) -> None:
        """Add existing labels."""
        self._fixed.append(labels)

    def add_dot(self, x: float, value: float, css: str, radius: float) -> None:
        """Add a dot that remains circular, at 0 to 1000 of the width."""
        self._fixed.append(
            f'<svg x="{format_coordinate(x / 10)}%" y="{format_coordinate(self.px(value))}" '
            f'overflow="visible" width="1" height="1"><circle class="{css}" r="{radius}"/></svg>'
        )

    def draw(self, css: str, title: str, attributes: str = "") -> str:
        """Return the chart in a `<div>` with this class, with a title for screen readers."""
        return (
            f'<div class="{css}"{attributes}>'
            f'<svg width="100%" height="{self.height}" overflow="visible" role="img">'
            f"<title>{escape(title)}</title>{stretch(''.join(self._stretched))}{''.join(self._fixed)}</svg></div>"
        )
