"""Movement analysis profile: distance of each curve from healthy adults.

docs/science/norms-and-scores.md, "GVS and GPS".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, cast

from sagittal.core.frames import SIDES, Side
from sagittal.core.message import Message
from sagittal.core.norms.profile import Mode
from sagittal.core.norms.scores import Score, Scores
from sagittal.server.report.charts.svg import draw_bar, format_coordinate
from sagittal.server.report.words.change_words import SCORE_TERMS
from sagittal.server.report.words.wording import VARIABLES, format_number, reason_words

SCALE_DEG: Final = 24.0
"""Right end of the bars; a GVS of 24° exceeds all pathologies in the tables."""

WIDTH: Final = 150

BARS_DEG: Final = 16.0
BAR_HEIGHT: Final = 31
PAPER_BAR_HEIGHT: Final = 16
"""Of a curve's bar in px."""
"""Right end of the bars on the session page."""

LABELS: Final = {v.name: v.label for v in VARIABLES} | {"foot_progression": "Foot progression"}
PLANES: Final = {v.name: v.plane for v in VARIABLES}

MODE: Final[Mode] = "offset_removed"
"""Our angles are relative to the patient's own standing posture, so offsets carry no information; the shape
does.
"""


TOTALS: Final[tuple[tuple[str, Mode, str], ...]] = (
    ("gps_sagittal_deg", "offset_removed", "Sagittal profile score, levels removed"),
    ("gps_deg", "offset_removed", "GPS, levels removed"),
    ("gps_sagittal_deg", "raw", "Sagittal profile score, with levels"),
    ("gps_deg", "raw", "GPS"),
)
"""Profiles over several curves → titles; those with offsets need goniometer angles in standing."""


@dataclass(frozen=True)
class ProfileRow:
    """A bar of the profile: GVS of one variable, or a profile over several, in degrees as text.

    Parameters
    ----------
    left, right, healthy, svg : against subjects at the patient's speed if `ProfileView.at_speed`.
    comfortable_left, comfortable_right : against subjects at comfortable speed, "" if the above already are.
    """

    title: str
    left: str
    right: str
    healthy: str
    svg: str
    low_confidence: bool
    total: bool
    comfortable_left: str = ""
    comfortable_right: str = ""


@dataclass(frozen=True)
class ProfileBar:
    """A row as numbers, degrees: of each side with a value, and of healthy subjects if known."""

    title: str
    values: Mapping[Side, float]
    median: float | None
    p95: float | None


@dataclass(frozen=True)
class ProfileView:
    """Rows of the profile, GDI* in words, its limitations, and the reference group.

    Parameters
    ----------
    at_speed : the reference group was asked to walk at the patient's speed.
    bars : of the curves with high confidence. score : sagittal profile score over them, with offsets removed,
        against subjects at comfortable speed, as in trends; None if too many curves are missing.
    score_at_speed : the score against subjects at the patient's speed, None if unavailable.
    """

    rows: tuple[ProfileRow, ...]
    index: str
    note: str
    at_speed: bool = False
    bars: tuple[ProfileBar, ...] = ()
    score: ProfileBar | None = None
    score_at_speed: ProfileBar | None = None


def profile_view(comfortable: Scores, matched: Scores | None = None) -> ProfileView | None:
    """View of a profile; None if no curve could be scored.

    Parameters
    ----------
    comfortable, matched : scores of the same curves, against subjects at comfortable speed and at the
        patient's speed; None if unavailable.
    """
    scores = comfortable if matched is None else matched
    rows, bars = [], []
    for variable in dict.fromkeys(s.variable for s in scores.scores if s.variable is not None):
        side_scores = {side: scores.find("gvs_deg", MODE, side, variable) for side in SIDES}
        if any(s.value is not None for s in side_scores.values()):
            label, plane = LABELS.get(variable, variable), PLANES.get(variable)
            row = _row(label, side_scores, low=plane != "sagittal", total=False)
            rows.append(_beside(row, comfortable, scores, "gvs_deg", MODE, variable))
            if plane == "sagittal":
                bars.append(_numbers(label, side_scores))
    if not rows:
        return None
    for name, mode, title in TOTALS:
        by_side = {side: scores.find(name, mode, side) for side in SIDES}
        if any(s.value is not None for s in by_side.values()):
            row = _row(title, by_side, low=name == "gps_deg", total=True)
            rows.append(_beside(row, comfortable, scores, name, mode))
    return ProfileView(
        tuple(rows),
        _index(comfortable),
        _note(scores),
        scores.speed_matched,
        tuple(bars),
        _total(comfortable),
        None if matched is None else _total(matched),
    )


def _total(scores: Scores) -> ProfileBar | None:
    by_side = {side: scores.find("gps_sagittal_deg", MODE, side) for side in SIDES}
    total = _numbers(SCORE_TERMS["gps_sagittal_deg"].label, by_side)
    return total if total.values else None


def bar_svg(bar: ProfileBar, previous: ProfileBar | None, height: int = BAR_HEIGHT) -> str:
    """Draw the bars of both sides, left filled, right outlined, with a tick at the previous visit.

    Solid line: median of healthy subjects; dashed: 95th percentile. Bars are clipped at BARS_DEG. `height` in
    px.
    """

    def x(value: float) -> str:
        return f"{format_coordinate(100 * min(value, BARS_DEG) / BARS_DEG)}%"

    thick = 0.29 * height
    shapes = []
    for side, css, y in (("left", "mapl", 0.15 * height), ("right", "mapr", 0.58 * height)):
        value = bar.values.get(cast("Side", side))
        if value is not None:
            shapes.append(f'<rect class="{css}" x="0" y="{y:.1f}" width="{x(value)}" height="{thick:.1f}"/>')
        earlier = None if previous is None else previous.values.get(cast("Side", side))
        if earlier is not None:
            x_earlier = x(earlier)
            ends = f'y1="{y - 0.07 * height:.1f}" y2="{y + 0.36 * height:.1f}"'
            shapes.append(f'<line class="mapb" x1="{x_earlier}" x2="{x_earlier}" {ends}/>')
    for css, end in (("mapm", bar.median), ("map95", bar.p95)):
        if end is not None:
            shapes.append(f'<line class="{css}" x1="{x(end)}" x2="{x(end)}" y1="0" y2="{height}"/>')
    drawn = "".join(shapes)
    return f'<svg class="chart mapbar" width="100%" height="{height}" aria-hidden="true">{drawn}</svg>'


def _numbers(title: str, by_side: Mapping[Side, Score]) -> ProfileBar:
    healthy = next((s.healthy for s in by_side.values() if s.healthy is not None), None)
    return ProfileBar(
        title,
        {side: s.value for side, s in by_side.items() if s.value is not None},
        None if healthy is None else healthy.median_deg,
        None if healthy is None else healthy.p95_deg,
    )


def _beside(
    row: ProfileRow, comfortable: Scores, scores: Scores, name: str, mode: Mode, variable: str | None = None
) -> ProfileRow:
    """The row with added scores against subjects at comfortable speed, if others are shown."""
    if comfortable is scores:
        return row
    left, right = (_text(comfortable.find(name, mode, side, variable)) for side in SIDES)
    return replace(row, comfortable_left=left, comfortable_right=right)


def _row(title: str, by_side: dict[Side, Score], *, low: bool, total: bool) -> ProfileRow:
    healthy = next((s.healthy for s in by_side.values() if s.healthy is not None), None)
    marks = {side: s.value for side, s in by_side.items() if s.value is not None}
    ends = None if healthy is None else (healthy.median_deg, healthy.p75_deg, healthy.p95_deg)
    return ProfileRow(
        title=title,
        left=_text(by_side["left"]),
        right=_text(by_side["right"]),
        healthy="" if healthy is None else format_number(healthy.median_deg, 1),
        svg=_bar(marks, ends),
        low_confidence=low,
        total=total,
    )


def _text(score: Score) -> str:
    return "–" if score.value is None else format_number(score.value, 1)


def _bar(marks: dict[Side, float], healthy: tuple[float, float, float] | None) -> str:
    """Bar to the 75th (dark) and 95th percentile (light) of healthy subjects with median, left and right
    marks.
    """
    median, p75, p95 = healthy or (None, None, None)
    boxes = [(0.0, end) for end in (p95, p75) if end is not None]
    return draw_bar(marks, boxes, median, (0.0, SCALE_DEG), WIDTH)


def _index(scores: Scores) -> str:
    """GDI* of the sagittal profile; a missing index is given with its reason."""
    parts = []
    for side in SIDES:
        s = scores.find("gdi_star_sagittal", MODE, side)
        if s.value is not None:
            parts.append(f"{side} {format_number(s.value)}")
    return (
        Message(
            "GDI*, sagittal: {parts} (100: mean of healthy adults at their own speed; 10 points: one SD).",
            parts=", ".join(parts),
        )
        if parts
        else ""
    )


def _note(scores: Scores) -> str:
    gps = scores.find("gps_deg", MODE, "left")
    missing = [LABELS.get(v, v.replace("_", " ").capitalize()).lower() for v in gps.missing]
    without = (
        Message(
            "GPS not available: {missing} ({reason}).",
            missing=", ".join(missing),
            reason=reason_words(gps.reason),
        )
        if gps.value is None and missing
        else ""
    )
    people = (
        "healthy adults asked to walk at this speed"
        if scores.speed_matched
        else Message(
            "{reference_n} healthy adults at their own comfortable speed", reference_n=scores.reference_n
        )
    )
    measured = Message(
        "Root-mean-square deviation of each mean curve from that of {people}. The level of each curve is "
        "removed because angles are relative to the person's standing. Dark: up to the 75th, light: up "
        "to the 95th percentile of these adults; line: median.",
        people=people,
    )
    return " ".join(filter(None, (measured, without, f"{scores.source}.")))
