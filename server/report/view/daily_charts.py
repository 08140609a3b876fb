"""Charts of daily life: activity ribbon, trunk inclination, walking bouts, steps.

Activities are distinguished by colour and bar height; unknown periods are hatched or dotted. Follows the
conventions of all charts (server/report/charts/svg.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import pairwise
from typing import Final

import numpy as np

from sagittal.core.activity.result import KINDS, ActivityKind, ActivityResult
from sagittal.core.frames import Floats
from sagittal.core.message import Message
from sagittal.server.report.charts.svg import PlotArea, find_round_ticks, format_coordinate, make_label
from sagittal.server.report.view.daily_life import COURSE_S, BoutBin, DayTotals, inclination_course
from sagittal.server.report.words.daily_words import DASH, DAY_S, KIND_LABELS, TOTALS, format_hours
from sagittal.server.report.words.wording import format_number

RIBBON_PX: Final = 52
"""Height of a day's ribbon."""

SLOT_S: Final = 30
"""A ribbon shows the predominant activity of each half minute; at 1000 px a pixel covers almost three."""

SLOTS: Final = int(DAY_S) // SLOT_S

LEVELS: Final[dict[ActivityKind, float]] = {
    "lying": 0.25,
    "sitting": 0.5,
    "standing": 0.75,
    "walking": 1.0,
    "stairs_up": 1.0,
    "stairs_down": 1.0,
    "unknown": 0.5,
    "non_wear": 0.5,
    "gap": 0.5,
}
"""Height of the bar of each activity, fraction of the ribbon."""

CSS: Final[dict[ActivityKind, str]] = {
    "lying": "ak-lie",
    "sitting": "ak-sit",
    "standing": "ak-stand",
    "walking": "ak-walk",
    "stairs_up": "ak-walk",
    "stairs_down": "ak-walk",
}
"""Class of coloured areas."""

PATTERNS: Final[dict[ActivityKind, str]] = {
    "stairs_up": "ap-up",
    "stairs_down": "ap-down",
    "unknown": "ap-unknown",
    "non_wear": "ap-off",
    "gap": "ap-gap",
}
"""Pattern over the bar; defined once per page (web/templates/_daily_patterns.html)."""

HOURS: Final = (0, 3, 6, 9, 12, 15, 18, 21, 24)
LEAN_RANGE: Final = (-90.0, 90.0)


def ribbon_svg(activity: ActivityResult, day: DayTotals) -> str:
    """Draw the activities of 24 hours."""
    plot = PlotArea((0.0, 1.0), RIBBON_PX)
    for hour in range(25):
        plot.add_upright("ax" if hour % 6 == 0 else "g", 1000 * hour / 24)
    for kind, pieces in _find_pieces(activity, day).items():
        if kind in CSS:
            plot.add(
                f'<path class="{CSS[kind]}" d="{"".join(_box(a, b, LEVELS[kind]) for a, b in pieces)}"/>'
            )
        if kind in PATTERNS:
            plot.add_fixed("".join(_patterned(kind, a, b) for a, b in pieces))
    _add_hours(plot, activity)
    summary = ", ".join(f"{c.lower()} {day.times[c]}" for c in TOTALS if day.times[c] != "0:00")
    return plot.draw(
        "chart ribbon", Message("{label}, hours and minutes: {summary}", label=day.label, summary=summary)
    )


def kind_swatch(kind: ActivityKind) -> str:
    """Draw the legend symbol of an activity."""
    width, height = 26, 14
    top = format_coordinate(height * (1.0 - LEVELS[kind]))
    box = f'x="0" y="{top}" width="{width}" height="{format_coordinate(height * LEVELS[kind])}"'
    filled = f'<rect class="{CSS[kind]}" {box}/>' if kind in CSS else ""
    over = f'<rect fill="url(#{PATTERNS[kind]})" {box}/>' if kind in PATTERNS else ""
    return (
        f'<svg class="chart swatch" width="{width}" height="{height}" aria-hidden="true">'
        f'{filled}{over}<line class="ax" x1="0" x2="{width}" y1="{height}" y2="{height}"/></svg>'
    )


def inclination_svg(activity: ActivityResult, day: DayTotals) -> str:
    """Draw trunk inclination over 24 hours: median and central 80 % of every ten minutes."""
    plot = PlotArea(LEAN_RANGE, RIBBON_PX)
    for hour in range(0, 25, 6):
        plot.add_upright("ax", 1000 * hour / 24)
    for tick in (-90.0, 0.0, 90.0):
        plot.add_tick("z" if tick == 0.0 else "g", tick, f"{format_number(tick, 0)}°")
    t_s, course = inclination_course(activity, day.start_s, day.end_s)
    x = 1000 * (t_s - day.midnight_s) / DAY_S
    wide = 1000 * COURSE_S / DAY_S
    for run in _known_runs(course[:, 1]):
        ends = (*x[run].tolist(), float(x[run][-1]) + wide)
        plot.add(f'<path class="lean-range" d="{_outline(plot, ends, course[run])}"/>')
        middle = "".join(
            f"{'L' if k else 'M'}{_point(a, plot.y(v))}L{_point(b, plot.y(v))}"
            for k, (a, b, v) in enumerate(zip(ends[:-1], ends[1:], course[run, 1].tolist(), strict=True))
        )
        plot.add(f'<path class="mb" d="{middle}"/>')
    _add_hours(plot, activity)
    medians = course[np.isfinite(course[:, 1]), 1]
    summary = (
        Message(
            "medians of ten minutes from {min:.0f} to {max:.0f} degrees", min=medians.min(), max=medians.max()
        )
        if len(medians)
        else "not known"
    )
    return plot.draw(
        "chart ribbon", Message("Trunk inclination on {label}: {summary}", label=day.label, summary=summary)
    )


def bouts_svg(bins: Sequence[BoutBin]) -> str:
    """Draw the number of walking bouts by length."""
    bars = [(b.label, float(b.bouts), True) for b in bins]
    return bars_svg(bars, "Walking bouts by length; values in the table", height=150)


def steps_svg(activity: ActivityResult, days: Sequence[DayTotals]) -> str:
    """Draw steps per day, or per hour for a single day."""
    if len(activity.days) > 1:
        bars = [
            (d.label, float(own.steps) if own.worn_h > 0.0 else None, d.counted)
            for d, own in zip(days, activity.days, strict=True)
        ]
        return bars_svg(bars, "Steps per day; values in the table", height=150)
    counts = np.zeros(24)
    for h in activity.hours:
        counts[int((h.start_s - days[0].midnight_s) // 3600) % 24] += h.steps
    hours = [(str(i) if i % 3 == 0 else "", float(n), True) for i, n in enumerate(counts.tolist())]
    return bars_svg(hours, "Steps per hour; values in the table", height=150, values=False)


def bars_svg(
    bars: Sequence[tuple[str, float | None, bool]], title: str, height: int, *, values: bool = True
) -> str:
    """Draw bars with their values above them.

    Parameters
    ----------
    bars : label, height (None = unknown, drawn as a dash), and whether complete; incomplete ones are dashed.
    values : write the numbers.
    """
    top = max((value for _, value, _ in bars if value is not None), default=0.0) or 1.0
    plot = PlotArea((0.0, 1.12 * top), height)
    ticks, digits = find_round_ticks(0.0, top)
    for tick in ticks:
        plot.add_tick("z" if tick == 0.0 else "g", tick, format_number(tick, digits))
    wide = 1000 / max(len(bars), 1)
    for i, (label, value, full) in enumerate(bars):
        middle = (i + 0.5) * wide
        if value:
            plot.add_band("bar" if full else "bar part", 0.0, value, middle - 0.35 * wide, 0.7 * wide)
        x_text = f"{format_coordinate(middle / 10)}%"
        plot.add_text(x_text, height, label, "", "middle", dy=16)
        if values:
            text = DASH if value is None else format_number(value, 0)
            plot.add_text(x_text, plot.px(value or 0.0), text, "strong", "middle", dy=-5)
    return plot.draw("chart bars", title)


def _find_pieces(activity: ActivityResult, day: DayTotals) -> dict[ActivityKind, list[tuple[int, int]]]:
    """Runs of half minutes [first, last) of every activity; none outside the recording."""
    share = np.zeros((len(KINDS), SLOTS))
    for s in activity.spans:
        a = (max(s.start_s, day.start_s) - day.midnight_s) / SLOT_S
        b = (min(s.end_s, day.end_s) - day.midnight_s) / SLOT_S
        if b <= a:
            continue
        row, first, last = share[KINDS.index(s.kind)], int(a), min(int(b), SLOTS - 1)
        if first >= last:
            row[last] += b - a
            continue
        row[first] += first + 1 - a
        row[first + 1 : last] += 1.0
        row[last] += b - last
    kinds = np.where(share.sum(axis=0) > 0.0, share.argmax(axis=0), -1)
    edges = [0, *(np.flatnonzero(np.diff(kinds)) + 1).tolist(), SLOTS]
    pieces: dict[ActivityKind, list[tuple[int, int]]] = {}
    for a, b in pairwise(edges):
        if kinds[a] >= 0:
            pieces.setdefault(KINDS[kinds[a]], []).append((a, b))
    return pieces


def _box(first: int, last: int, level: float) -> str:
    """Path of a bar, 0 to 1000 both ways."""
    x, wide = 1000 * first / SLOTS, 1000 * (last - first) / SLOTS
    return f"M{x:.2f} 1000V{format_coordinate(1000 * (1 - level))}h{wide:.2f}V1000z"


def _patterned(kind: ActivityKind, first: int, last: int) -> str:
    """A bar with a pattern that does not stretch."""
    height = RIBBON_PX * LEVELS[kind]
    return (
        f'<rect fill="url(#{PATTERNS[kind]})" x="{100 * first / SLOTS:.3f}%" '
        f'width="{100 * (last - first) / SLOTS:.3f}%" y="{format_coordinate(RIBBON_PX - height)}" '
        f'height="{format_coordinate(height)}"><title>{escape(KIND_LABELS[kind])}, '
        f"{format_hours((last - first) * SLOT_S / 60)} h</title></rect>"
    )


def _add_hours(plot: PlotArea, activity: ActivityResult) -> None:
    unit = ":00" if activity.started_at is not None else "\u202fh"
    for hour in HOURS:
        anchor = "start" if hour == 0 else "end" if hour == 24 else "middle"
        x_text = f"{format_coordinate(100 * hour / 24)}%"
        plot.add_fixed(make_label(x_text, plot.height, f"{hour}{unit}", "", anchor, dy=14))


def _known_runs(values: Floats) -> list[slice]:
    """Runs without NaN."""
    finite = np.concatenate(([False], np.isfinite(values), [False]))
    starts = np.flatnonzero(~finite[:-1] & finite[1:]).tolist()
    ends = np.flatnonzero(finite[:-1] & ~finite[1:]).tolist()
    return [slice(a, b) for a, b in zip(starts, ends, strict=True)]


def _outline(plot: PlotArea, ends: Sequence[float], course: Floats) -> str:
    """Outline along the upper values and back along the lower ones."""
    up = [(x, plot.y(v)) for i, v in enumerate(course[:, 2].tolist()) for x in (ends[i], ends[i + 1])]
    low = [(x, plot.y(v)) for i, v in enumerate(course[:, 0].tolist()) for x in (ends[i], ends[i + 1])]
    return "M" + "L".join(_point(x, y) for x, y in (*up, *reversed(low))) + "z"


def _point(x: float, y: float) -> str:
    return f"{x:.2f} {format_coordinate(y)}"
