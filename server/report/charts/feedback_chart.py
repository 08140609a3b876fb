"""Chart of a trial with feedback: strides over the zone of their level, solid with feedback, open without.

Follows the conventions of the cycle curves (server/report/charts/svg.py): the plot stretches, dots and text
do not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import Final

from sagittal.core.feedback import FeedbackSplit, Prescription
from sagittal.core.feedback.summary import MatchedStride
from sagittal.core.message import Message
from sagittal.server.report.charts.svg import KEY, PlotArea, find_round_ticks, format_coordinate
from sagittal.server.report.words.wording import Term, format_number

HEIGHT: Final = 190
TOP, BOTTOM = 12, 34
"""Chart and its margins, px, the padding of `<div class="chart fb-plot">`."""

FAR: Final = 6.0
"""Values further than this many level widths outside the zones are drawn at the edge of the chart."""


NARROW: Final = 50.0
"""Runs of strides narrower than this, of 1000, have no label, as it would touch the next."""


def feedback_svg(split: FeedbackSplit, content: Prescription, term: Term) -> str:
    """Draw the strides in order.

    Parameters
    ----------
    split : with at least one stride.
    """
    strides = split.strides
    low, high = _range(strides, content)
    plot = PlotArea((low, high), HEIGHT - TOP - BOTTOM)

    def x(i: float) -> float:
        return 1000.0 * (i + 0.5) / len(strides)

    for i, j, m in _runs(strides, _block):
        word = _block(m)
        if word:
            left, width = x(i - 0.5), x(j + 0.5) - x(i - 0.5)
            plot.add_column("fb-block", left, width)
            if width >= NARROW:
                x_text = f"{format_coordinate((left + width / 2) / 10)}%"
                plot.add_text(x_text, plot.height + 14, word, "words", "middle")
    for i, j, m in _runs(strides, lambda m: (m.cue.zone_low, m.cue.zone_high)):
        plot.add_band("band", m.cue.zone_low, m.cue.zone_high, x(i - 0.5), x(j + 0.5) - x(i - 0.5))
    ticks, digits = find_round_ticks(low, high)
    for tick in ticks:
        plot.add_tick("g", tick, format_number(tick, digits))
    mean = content.target.mean
    if mean is not None and low <= mean <= high:
        plot.add_level("nm", mean)
    for i, m in enumerate(strides):
        css = f"{'fb-on' if m.cue.with_feedback else 'fb-off'} {KEY[m.cue.side]}"
        plot.add_dot(x(i), min(max(m.value, low), high), css, 2.6)
    for i, j, m in _runs(strides, lambda m: (_opens(m), m.cue.level)):
        if not _opens(m) and x(j + 0.5) - x(i - 0.5) >= NARROW:
            x_text = f"{format_coordinate(x(i - 0.5) / 10)}%"
            plot.add_text(
                x_text, plot.height + 28, Message("level {level}", level=m.cue.level), "words", "start"
            )
    title = Message(
        "{label} of every stride against the target zone of its level; values in the table", label=term.label
    )
    return plot.draw("chart fb-plot", title)


def _opens(m: MatchedStride) -> bool:
    """Whether the stride belongs to the opening block of a visit, which may have no level yet."""
    return m.cue.why_not in {"baseline", "retention"}


def _block(m: MatchedStride) -> str:
    """Name of a block without feedback, "" in training."""
    reason = m.cue.why_not
    if reason == "baseline":
        return "before"
    return reason if reason in {"probe", "retention"} else ""


def _runs(
    strides: Sequence[MatchedStride], key: Callable[[MatchedStride], object]
) -> Iterator[tuple[int, int, MatchedStride]]:
    """First and last index of consecutive strides with the same key, and the first stride."""
    start = 0
    for _, group in groupby(strides, key):
        members = list(group)
        yield start, start + len(members) - 1, members[0]
        start += len(members)


def _range(strides: Sequence[MatchedStride], content: Prescription) -> tuple[float, float]:
    """Limits of the value axis: zones and values, excluding distant outliers."""
    low = min(m.cue.zone_low for m in strides)
    high = max(m.cue.zone_high for m in strides)
    width = (content.target.sd or 0.0) * content.progression.sd_per_level or (high - low)
    values = [m.value for m in strides]
    low, high = min(low, max(min(values), low - FAR * width)), max(high, min(max(values), high + FAR * width))
    room = 0.06 * (high - low) or 1.0
    return low - room, high + room
