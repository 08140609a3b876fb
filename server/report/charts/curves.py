"""Cycle curves, range bars and the stride strip, for pages and print (server/report/charts/svg.py)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import Final

import numpy as np

from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.core.signals.rest import find_runs
from sagittal.core.user_text import quote
from sagittal.server.report.charts.panels import CurvePanel, SideCurve
from sagittal.server.report.charts.svg import (
    KEY,
    PlotArea,
    draw_bar,
    format_coordinate,
    make_label,
    make_time_labels,
    stretch,
)
from sagittal.server.report.words.wording import explain_exclusion, format_number

X_TICKS: Final = (0, 20, 40, 60, 80, 100)


@dataclass(frozen=True)
class CycleWords:
    """Name of the cycle, name of its parts, and unit of the x axis."""

    over: str
    counted: str
    unit: str


STRIDE: Final = CycleWords("the gait cycle", "strides", "% of gait cycle")
SQUAT: Final = CycleWords("the squat", "squats", "% of squat")

GLANCE_STRIDES: Final = 5

_TOP, _BOTTOM, _BOTTOM_WITH_UNIT = 18, 20, 34
_CLOSE_PCT = 6.0


def cycle_svg(
    panel: CurvePanel,
    *,
    height: int = 176,
    x_unit: bool = False,
    single_strides: bool = True,
    glance: bool = False,
    earlier: CurvePanel | None = None,
    over: CycleWords = STRIDE,
) -> str:
    """Draw one chart from back to front: band, grid, foot-off, single strides, means, cursor, text.

    Parameters
    ----------
    height : px including margins, which the stylesheet sets to 18 above and 20 (34 with `x_unit`) below.
    x_unit : print the unit of the x axis; once per column. over : cycle of the curves.
    single_strides : draw thin single strides, each a path with its index in the stride list as `data-stride`.
    glance : draw at most `GLANCE_STRIDES` single strides per side, spread over the trial; these and the norm
        in steps of 4 %, means in steps of 2 %, which takes a third of the bytes.
    earlier : the same variable in an earlier session; its means are drawn thin, in the background.

    Returns
    -------
    str
        A `<div class="chart cycle">`; empty if the panel has no curve.
    """
    if panel.reason is not None:
        return ""
    v = panel.variable
    plot = _CyclePlot(v.y_range, height - _TOP - (_BOTTOM_WITH_UNIT if x_unit else _BOTTOM))
    if panel.norm is not None:
        plot.norm(panel.norm.mean_deg, panel.norm.sd_deg, glance)
    if panel.comfortable is not None:
        plot.curve(panel.comfortable.mean_deg, "cm", 4 if glance else 1)
    plot.grid(v.ticks)
    for side, curve in panel.sides.items():
        plot.foot_off_spread(side, curve)
    if single_strides:
        for side, curve in panel.sides.items():
            plot.strides(side, curve, glance)
    for css, drawn in (("pv", {} if earlier is None else earlier.sides), ("m", panel.sides)):
        for side, curve in drawn.items():
            if curve.mean_deg is not None:
                plot.curve(curve.mean_deg, f"{css}{KEY[side]}", 2 if glance else 1)
    plot.foot_offs(panel.sides)
    plot.cursor()
    plot.x_axis(over.unit if x_unit else None)
    plot.words(v.up, v.down)
    n = ", ".join(f"{side} mean of {c.n}" for side, c in panel.sides.items())
    last = [c.n for c in panel.sides.values()][-1:] or [0]
    noun = plural(last[0], over.counted.removesuffix("s"), over.counted)
    return plot.draw(
        "chart cycle x-unit" if x_unit else "chart cycle",
        Message("{title} over {over}: {value} {noun}", title=panel.title, over=over.over, value=n, noun=noun),
        f' data-variable="{v.name}"',
    )


def range_svg(
    marks: Mapping[str, float],
    norm: tuple[float, float] | None,
    scale: tuple[float, float],
    width: int = 120,
) -> str:
    """Draw one row of the parameter table: norm ± 1 SD as a box with its mean; values are clipped.

    Parameters
    ----------
    marks : "left" (filled disc), "right" (ring) or "both" (dark disc) → value.
    norm : mean and standard deviation.
    """
    boxes = [] if norm is None else [(norm[0] - norm[1], norm[0] + norm[1])]
    return draw_bar(marks, boxes, None if norm is None else norm[0], scale, width)


def strip_svg(strides: Strides, duration_s: float, height: int = 92) -> str:
    """Draw all strides over time with the cursor: stance solid, swing light, excluded ones faded and crossed.

    Every stride is a `<g>`, in the order of the stride list. Excluded strides state their reason; labels of
    the others are added by the page's script, as there are many.
    """
    plot_height = height - 24
    marks = "".join(_stride_mark(s, duration_s) for s in strides.strides)
    letters = "".join(
        make_label("0", plot_height * (0.25 + 0.5 * i), side[0].upper(), f"t{KEY[side]}", "end", dx=-9, dy=4)
        for i, side in enumerate(SIDES)
    )
    return (
        f'<div class="chart strip"><svg width="100%" height="{plot_height}" overflow="visible" role="img">'
        "<title>Strides of this trial over time; a cross marks an excluded stride</title>"
        f'{stretch(marks)}<line class="cursor now" x1="0" x2="0" y1="0" y2="100%"/>'
        f"{letters}{make_time_labels(duration_s, plot_height, 15)}</svg></div>"
    )


def _stride_mark(s: Stride, duration_s: float) -> str:
    k, top, out = KEY[s.side], 40 if s.side == "left" else 540, s.excluded_reason is not None
    start, end = round(1000 * s.start_s / duration_s), round(1000 * s.end_s / duration_s)
    off = end if s.tc_s is None else round(1000 * s.tc_s / duration_s)
    title_element, cross = "", ""
    if s.excluded_reason is not None:
        title = Message(
            "{side} stride, {start_s:.2f} to {end_s:.2f} s, excluded: ",
            side=s.side,
            start_s=s.start_s,
            end_s=s.end_s,
        )
        title_element = f"<title>{escape(title + quote(explain_exclusion(s.excluded_reason)))}</title>"
        width = end - start
        cross = f'<path class="xx" d="M{start} {top + 60}l{width} 300M{start} {top + 360}l{width}-300"/>'
    faded = " x" if out else ""
    return (
        f"<g>{title_element}"
        f'<path class="st{k}{faded}" d="M{start} {top}H{off}v420H{start}"/>'
        f'<path class="sw{k}{faded}" d="M{off} {top}H{end}v420H{off}"/>'
        f"{cross}</g>"
    )


class _CyclePlot(PlotArea):
    """A plot over the gait cycle, 0 to 100 %."""

    def norm(self, mean: Floats, sd: Floats, glance: bool) -> None:
        step = 4 if glance else 1
        upper, lower = self._points(mean + sd)[::step], self._points(mean - sd)[::step]
        self.add(f'<polygon class="band" points="{" ".join(upper + lower[::-1])}"/>')
        self.curve(mean, "nm", step)

    def grid(self, ticks: Sequence[float]) -> None:
        for tick in ticks:
            self.add_tick("z" if tick == 0 else "g", tick, f"{format_number(tick)}°")

    def foot_off_spread(self, side: Side, curve: SideCurve) -> None:
        if curve.foot_off_pct is not None and curve.foot_off_sd is not None:
            x, w = 10 * (curve.foot_off_pct - curve.foot_off_sd), 20 * curve.foot_off_sd
            self.add_column(f"fos{KEY[side]}", x, w)

    def strides(self, side: Side, curve: SideCurve, glance: bool) -> None:
        step = 4 if glance else 2
        apart = -(-len(curve.strides) // GLANCE_STRIDES) if glance else 1
        for index, angle in list(curve.strides.items())[:: max(1, apart)]:
            d = self._path(angle[::step], step)
            self.add(f'<path class="s{KEY[side]}" data-stride="{index}" d="{d}"/>')

    def curve(self, angle: Floats, css: str, step: int) -> None:
        self.add(f'<path class="{css}" d="{self._path(angle[::step], step)}"/>')

    def foot_offs(self, sides: Mapping[Side, SideCurve]) -> None:
        pct_by_side = {s: c.foot_off_pct for s, c in sides.items() if c.foot_off_pct is not None}
        # labels are placed at their lines, the earlier one to the left; overlapping ones are shifted
        earlier = min(pct_by_side, key=lambda side: pct_by_side[side], default=None)
        close = len(pct_by_side) == 2 and max(pct_by_side.values()) - min(pct_by_side.values()) < _CLOSE_PCT
        for side, x in pct_by_side.items():
            self.add_upright(f"fo{KEY[side]}", 10 * x)
            anchor, out = ("end", -1) if side == earlier and len(pct_by_side) == 2 else ("start", 1)
            label = f"{side[0].upper()}\u2009{x:.0f}"
            self.add_text(
                f"{format_coordinate(x)}%", -5, label, f"t{KEY[side]}", anchor, dx=out * (3 if close else -4)
            )

    def cursor(self) -> None:
        self.add('<line class="cursor" x1="0" x2="0" y1="0" y2="1000" hidden="hidden"/>')

    def x_axis(self, unit: str | None) -> None:
        for tick in X_TICKS:
            self.add_text(f"{tick}%", self.height, str(tick), "", "middle", dy=15)
        if unit is not None:
            self.add_text("100%", self.height, unit, "", "end", dy=30)

    def words(self, up: str, down: str) -> None:
        self.add_text("0", 0, f"{up} ↑", "words halo", "start", dx=5, dy=11)
        self.add_text("0", self.height, f"{down} ↓", "words halo", "start", dx=5, dy=-5)

    def _points(self, angle: Floats) -> list[str]:
        return [f"{10 * i} {v}" for i, v in enumerate(self._heights(angle))]

    def _heights(self, angle: Floats) -> list[int]:
        """Integer thousandths of the plot from its top."""
        heights: list[int] = np.rint(1000 * (self.high - angle) / (self.high - self.low)).astype(int).tolist()
        return heights

    def _path(self, angle: Floats, step: int) -> str:
        """Path of a curve in % of the plot, interrupted where it has no value."""
        runs = find_runs(np.isfinite(angle))
        return "".join(self._run(angle[a:b], step, a) for a, b in runs)

    def _run(self, angle: Floats, step: int, first: int) -> str:
        """One continuous part of a curve: its first point, then relative moves."""
        y = self._heights(angle)
        step_x = 10 * step
        moves = " ".join([f"{step_x}{b - a:+d}" for a, b in pairwise(y)])
        return f"M{10 * step * first} {y[0]}" + (f"l{moves}" if moves else "")
