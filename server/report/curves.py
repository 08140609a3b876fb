"""The one SVG renderer: cycle curves, range bars and the stride strip, for page and print alike.

The margins are the padding of `<div class="chart cycle">`; the `<svg>` is the plot area. Curves live in a
nested `viewBox="0 0 1000 1000"` that stretches while strokes and text do not; labels are placed in percent.
Colours, widths and dashes come from CSS classes only (design tokens), so light, dark and paper need no second
drawing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Final

import numpy as np

from core.events.result import Stride, Strides
from core.frames import SIDES, Floats, Side
from server.report.panels import CurvePanel, SideCurve
from server.report.wording import excluded_words, number

KEY: Final[dict[Side, str]] = {"left": "l", "right": "r"}
"""Letter of a side in CSS classes."""

X_TICKS: Final = (0, 20, 40, 60, 80, 100)
_TOP, _BOTTOM, _BOTTOM_WITH_UNIT = 18, 20, 34
_CLOSE_PCT = 6.0


def cycle_svg(
    panel: CurvePanel,
    *,
    height: int = 176,
    x_unit: bool = False,
    single_strides: bool = True,
    earlier: CurvePanel | None = None,
) -> str:
    """Draw one panel: band, grid, foot-off, single strides, means, cursor, words, from back to front.

    Parameters
    ----------
    height : px with margins, of which the stylesheet gives 18 above and 20 (34 with `x_unit`) below.
    x_unit : print "% of gait cycle" below; once per column.
    single_strides : draw thin strides, each a path with its number in the stride list as `data-stride`.
    earlier : the same variable in an earlier session; its means are drawn thin, behind.

    Returns
    -------
    str
        A `<div class="chart cycle">`; empty when the panel has no curve.
    """
    if panel.reason is not None:
        return ""
    v = panel.variable
    plot = _Plot(v.y_range, height - _TOP - (_BOTTOM_WITH_UNIT if x_unit else _BOTTOM))
    if panel.norm is not None:
        plot.band(panel.norm.mean_deg, panel.norm.sd_deg)
    plot.grid(v.ticks)
    for side, curve in panel.sides.items():
        plot.foot_off_spread(side, curve)
    if single_strides:
        for side, curve in panel.sides.items():
            plot.strides(side, curve)
    for css, drawn in (("pv", {} if earlier is None else earlier.sides), ("m", panel.sides)):
        for side, curve in drawn.items():
            if curve.mean_deg is not None:
                plot.curve(curve.mean_deg, f"{css}{KEY[side]}")
    plot.foot_offs(panel.sides)
    plot.cursor()
    plot.x_axis("% of gait cycle" if x_unit else None)
    plot.words(v.up, v.down)
    n = ", ".join(f"{side} mean of {c.n}" for side, c in panel.sides.items())
    title = f"<title>{escape(panel.title)} over the gait cycle: {n} strides</title>"
    classes = "chart cycle x-unit" if x_unit else "chart cycle"
    return (
        f'<div class="{classes}" data-variable="{v.name}">'
        f'<svg width="100%" height="{plot.height}" overflow="visible" role="img">{title}{plot.svg()}</svg>'
        "</div>"
    )


def range_svg(
    marks: Mapping[str, float],
    norm: tuple[float, float] | None,
    scale: tuple[float, float],
    width: int = 120,
) -> str:
    """Draw one row of the parameter table: norm ± 1 SD as a box with its mean, values clipped at the ends.

    Parameters
    ----------
    marks : "left" a filled disc, "right" a ring, "both" a disc in ink → value.
    norm : mean and standard deviation.
    """

    def x(value: float) -> str:
        inside = (value - scale[0]) / (scale[1] - scale[0])
        return _f(min(max(6 + (width - 12) * inside, 6), width - 6))

    parts = [f'<line class="ax" x1="2" x2="{width - 2}" y1="13" y2="13"/>']
    if norm is not None:
        low, high = float(x(norm[0] - norm[1])), float(x(norm[0] + norm[1]))
        parts.append(f'<rect class="band" x="{_f(low)}" y="5" width="{_f(high - low)}" height="16" rx="2"/>')
        parts.append(f'<line class="nm" x1="{x(norm[0])}" x2="{x(norm[0])}" y1="5" y2="21"/>')
    for mark, css, radius in (("right", "dr", 4.6), ("left", "dl", 5.2), ("both", "ptf", 5.0)):
        if mark in marks:
            parts.append(f'<circle class="{css}" cx="{x(marks[mark])}" cy="13" r="{radius}"/>')
    return (
        f'<svg class="chart range" width="{width}" height="26" viewBox="0 0 {width} 26" aria-hidden="true">'
        f"{''.join(parts)}</svg>"
    )


def strip_svg(strides: Strides, duration_s: float, height: int = 92) -> str:
    """Draw all strides over time: stance full, swing light, left out faded with a cross, a line for now.

    Every stride is a `<g data-stride>` with its number in the stride list and a title in words.
    """
    plot_height = height - 24
    marks = "".join(_stride_mark(i, s, duration_s) for i, s in enumerate(strides.strides))
    letters = "".join(
        f'<text class="t{KEY[side]}" x="0" y="{_f(plot_height * (0.25 + 0.5 * i))}" dx="-9" dy="4" '
        f'text-anchor="end">{side[0].upper()}</text>'
        for i, side in enumerate(SIDES)
    )
    step = next((s for s in (1, 2, 5, 10, 30, 60) if duration_s / s <= 12), 120)
    ticks = "".join(
        f'<text x="{_f(100 * t / duration_s)}%" y="{plot_height}" dy="15" text-anchor="middle">'
        f"{t}\u2009s</text>"
        for t in range(0, int(duration_s) + 1, step)
    )
    return (
        f'<div class="chart strip"><svg width="100%" height="{plot_height}" overflow="visible" role="img">'
        "<title>Strides of this take over time; a cross marks a stride left out</title>"
        '<svg viewBox="0 0 1000 1000" preserveAspectRatio="none" width="100%" height="100%" '
        f'overflow="hidden">{marks}</svg><line class="cursor now" x1="0" x2="0" y1="0" y2="100%"/>'
        f"{letters}{ticks}</svg></div>"
    )


def _stride_mark(index: int, s: Stride, duration_s: float) -> str:
    k, top, out = KEY[s.side], 40 if s.side == "left" else 540, s.excluded_reason is not None
    start, end = 1000 * s.start_s / duration_s, 1000 * s.end_s / duration_s
    off = end if s.tc_s is None else 1000 * s.tc_s / duration_s
    said = f"{s.side} stride, {s.start_s:.2f} to {s.end_s:.2f} s"
    cross = ""
    if s.excluded_reason is not None:
        said += f", left out: {excluded_words(s.excluded_reason)}"
        a, b = f"{start:.2f}", f"{end:.2f}"
        cross = f'<path class="xx" d="M{a} {top + 60}L{b} {top + 360}M{a} {top + 360}L{b} {top + 60}"/>'
    faded = " x" if out else ""
    return (
        f'<g data-stride="{index}"><title>{escape(said)}</title>'
        f'<rect class="st{k}{faded}" x="{start:.2f}" width="{off - start:.2f}" y="{top}" height="420"/>'
        f'<rect class="sw{k}{faded}" x="{off:.2f}" width="{end - off:.2f}" y="{top}" height="420"/>'
        f"{cross}</g>"
    )


class _Plot:
    """Collects what stretches (0 to 1000 both ways) and what does not (percent and px)."""

    def __init__(self, y_range: tuple[float, float], height: int) -> None:
        self.height = height
        self._y_range = y_range
        self._stretched: list[str] = []
        self._fixed: list[str] = []

    def band(self, mean: Floats, sd: Floats) -> None:
        upper, lower = self._points(mean + sd), self._points(mean - sd)
        self._stretched.append(f'<polygon class="band" points="{" ".join(upper + lower[::-1])}"/>')
        self.curve(mean, "nm")

    def grid(self, ticks: Sequence[float]) -> None:
        for tick in ticks:
            y = self._y(tick)
            self._stretched.append(
                f'<line class="{"z" if tick == 0 else "g"}" x1="0" x2="1000" y1="{_f(y)}" y2="{_f(y)}"/>'
            )
            self._text("0", y / 1000 * self.height, f"{number(tick)}°", "", "end", dx=-7, dy=4)

    def foot_off_spread(self, side: Side, curve: SideCurve) -> None:
        if curve.foot_off_pct is not None and curve.foot_off_sd is not None:
            x, w = 10 * (curve.foot_off_pct - curve.foot_off_sd), 20 * curve.foot_off_sd
            self._stretched.append(
                f'<rect class="fos{KEY[side]}" x="{_f(x)}" width="{_f(w)}" y="0" height="1000"/>'
            )

    def strides(self, side: Side, curve: SideCurve) -> None:
        for index, angle in curve.strides.items():
            d = self._path(angle[::2], 2)
            self._stretched.append(f'<path class="s{KEY[side]}" data-stride="{index}" d="{d}"/>')

    def curve(self, angle: Floats, css: str) -> None:
        self._stretched.append(f'<path class="{css}" d="{self._path(angle, 1)}"/>')

    def foot_offs(self, sides: Mapping[Side, SideCurve]) -> None:
        found = {s: c.foot_off_pct for s, c in sides.items() if c.foot_off_pct is not None}
        # labels stand on their lines, the earlier one to the left; close ones make room for each other
        earlier = min(found, key=lambda side: found[side], default=None)
        close = len(found) == 2 and max(found.values()) - min(found.values()) < _CLOSE_PCT
        for side, x in found.items():
            self._stretched.append(
                f'<line class="fo{KEY[side]}" x1="{_f(10 * x)}" x2="{_f(10 * x)}" y1="0" y2="1000"/>'
            )
            anchor, out = ("end", -1) if side == earlier and len(found) == 2 else ("start", 1)
            label = f"{side[0].upper()}\u2009{x:.0f}"
            self._text(f"{_f(x)}%", -5, label, f"t{KEY[side]}", anchor, dx=out * (3 if close else -4))

    def cursor(self) -> None:
        self._stretched.append('<line class="cursor" x1="0" x2="0" y1="0" y2="1000" hidden="hidden"/>')

    def x_axis(self, unit: str | None) -> None:
        for tick in X_TICKS:
            self._text(f"{tick}%", self.height, str(tick), "", "middle", dy=15)
        if unit is not None:
            self._text("100%", self.height, unit, "", "end", dy=30)

    def words(self, up: str, down: str) -> None:
        self._text("0", 0, f"{up} ↑", "words halo", "start", dx=5, dy=11)
        self._text("0", self.height, f"{down} ↓", "words halo", "start", dx=5, dy=-5)

    def svg(self) -> str:
        return (
            '<svg viewBox="0 0 1000 1000" preserveAspectRatio="none" width="100%" height="100%" '
            f'overflow="hidden">{"".join(self._stretched)}</svg>{"".join(self._fixed)}'
        )

    def _y(self, angle: float) -> float:
        low, high = self._y_range
        return 1000 - 1000 * (angle - low) / (high - low)

    def _points(self, angle: Floats, step: int = 1) -> list[str]:
        low, high = self._y_range
        y = np.rint(1000 * (high - angle) / (high - low)).astype(np.int64).tolist()
        return [f"{10 * step * i} {v}" for i, v in enumerate(y)]

    def _path(self, angle: Floats, step: int) -> str:
        return "M" + "L".join(self._points(angle, step))

    def _text(self, x: str, y: float, text: str, css: str, anchor: str, dx: int = 0, dy: int = 0) -> None:
        self._fixed.append(
            f'<text class="{css}" x="{x}" y="{_f(y)}" dx="{dx}" dy="{dy}" text-anchor="{anchor}">'
            f"{escape(text)}</text>"
        )


def _f(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")
