"""Strides of a parameter, included and excluded, each with its time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

from sagittal.core.events.result import Strides
from sagittal.core.frames import SIDES, Side
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.rows import Column
from sagittal.core.user_text import quote
from sagittal.server.report.charts.svg import KEY, find_round_ticks, make_label, make_time_labels
from sagittal.server.report.files.columns import reduce_to_plain
from sagittal.server.report.view.level import define_parameter
from sagittal.server.report.view.table import ParameterRow
from sagittal.server.report.words.wording import explain_exclusion, format_number

HEIGHT: Final = 220
TOP, BOTTOM = 12, 24
"""Chart height and margins, px."""

CSS: Final[dict[Side, tuple[str, float]]] = {"left": ("dl", 5.2), "right": ("dr", 4.6)}


@dataclass(frozen=True)
class StrideValue:
    """Value of one stride, null if missing; `index` is its position in the stride list."""

    index: int
    side: Side
    start_s: float
    end_s: float
    value: float | None
    text: str
    counted: bool
    excluded: str | None


@dataclass(frozen=True)
class ParameterStrides:
    """One parameter and its strides.

    Parameters
    ----------
    row : as in the table. definition : in a sentence. strides : all strides; empty for a parameter not based
        on strides. svg : chart of the strides over time, empty without any.
    """

    row: ParameterRow
    definition: str
    strides: tuple[StrideValue, ...]
    svg: str

    def to_json(self) -> dict[str, object]:
        """Convert to JSON types."""
        content = {
            "parameter": self.row,
            "definition": self.definition,
            "strides": self.strides,
        }
        result = reduce_to_plain(content)
        return result if isinstance(result, dict) else {}


def open_row(
    row: ParameterRow, strides: Strides, column: Column | None, duration_s: float
) -> ParameterStrides:
    """Strides of a table row.

    Parameters
    ----------
    column : values of all strides, None if the parameter is not based on strides.
    """
    digits = CATALOGUE[row.name].digits if row.name in CATALOGUE else 2
    values = () if column is None else tuple(
        StrideValue(
            index=i,
            side=s.side,
            start_s=s.start_s,
            end_s=s.end_s,
            value=v,
            text="–" if v is None else format_number(v, max(digits, 2)),
            counted=s.excluded_reason is None,
            excluded=None if s.excluded_reason is None else explain_exclusion(s.excluded_reason),
        )
        for i, (s, v) in enumerate(zip(strides.strides, column, strict=True))
    )  # fmt: skip
    return ParameterStrides(row, define_parameter(row.name), values, _chart(row, values, duration_s))


def _chart(row: ParameterRow, values: Sequence[StrideValue], duration_s: float) -> str:
    """Chart of all strides as linked marks, with the norm as a band and means of the included ones as
    lines.
    """
    valued = [s for s in values if s.value is not None]
    if not valued or duration_s <= 0.0:
        return ""
    figures = [s.value for s in valued if s.value is not None]
    if row.norm_mean is not None and row.norm_sd is not None:
        figures += [row.norm_mean - row.norm_sd, row.norm_mean + row.norm_sd]
    low, high = min(figures), max(figures)
    pad = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    low, high = low - pad, high + pad
    plot = HEIGHT - TOP - BOTTOM

    def y(value: float) -> float:
        return TOP + plot * (high - value) / (high - low)

    parts = []
    if row.norm_mean is not None and row.norm_sd is not None:
        top, foot = y(row.norm_mean + row.norm_sd), y(row.norm_mean - row.norm_sd)
        parts.append(f'<rect class="band" x="0" width="100%" y="{top:.1f}" height="{foot - top:.1f}"/>')
    ticks, digits = find_round_ticks(low, high)
    for tick in ticks:
        parts.append(f'<line class="g" x1="0" x2="100%" y1="{y(tick):.1f}" y2="{y(tick):.1f}"/>')
        parts.append(make_label("0", y(tick), format_number(tick, digits), "", "end", dx=-7, dy=4))
    parts.append(make_time_labels(duration_s, HEIGHT, -6))
    for side, cell in zip(SIDES, (row.left, row.right), strict=True):
        if cell is not None:
            line = f'x1="0" x2="100%" y1="{y(cell.value):.1f}" y2="{y(cell.value):.1f}"'
            parts.append(f'<line class="m{KEY[side]}" {line}/>')
    parts += [_mark(s, y(s.value), duration_s) for s in valued if s.value is not None]
    return (
        f'<div class="chart behind"><svg width="100%" height="{HEIGHT}" overflow="visible" role="group">'
        f"<title>{escape(row.title)} of every stride over time</title>{''.join(parts)}</svg></div>"
    )


def _mark(s: StrideValue, y: float, duration_s: float) -> str:
    css, radius = CSS[s.side]
    x = 100 * 0.5 * (s.start_s + s.end_s) / duration_s
    title = f"{s.side} stride at {s.start_s:.2f} s: {s.text}" + (
        f", excluded: {quote(s.excluded)}" if s.excluded else ""
    )
    faded = "" if s.counted else " out"
    return (
        f'<a href="timeline#t={s.start_s:.3f}"><circle class="{css}{faded}" cx="{x:.2f}%" cy="{y:.1f}" '
        f'r="{radius}"><title>{escape(title)}</title></circle></a>'
    )
