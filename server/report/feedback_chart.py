"""Draws a take with feedback: every stride over the zone of its level, filled with feedback, open without.

The rules are those of the cycle curves (server/report/curves.py): the plot stretches, dots and text do not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from html import escape
from itertools import groupby
from typing import Final

from core.feedback import FeedbackSplit, Prescription
from core.feedback.summary import MatchedStride
from server.report.curves import KEY
from server.report.wording import Term, number

HEIGHT: Final = 190
TOP, BOTTOM = 12, 34
"""Chart and its margins, px, the padding of `<div class="chart fb-plot">`."""

TICKS: Final = 5
FAR: Final = 6.0
"""Values further than this many level widths beyond the zones lie on the edge of the chart."""


NARROW: Final = 50.0
"""Runs of strides narrower than this, of 1000, get no word: it would touch the next."""


def feedback_svg(split: FeedbackSplit, content: Prescription, term: Term) -> str:
    """Draw the strides in their order.

    Parameters
    ----------
    split : with at least one stride.
    """
    strides = split.strides
    low, high = _range(strides, content)
    inner = HEIGHT - TOP - BOTTOM

    def y(value: float) -> float:
        return 1000.0 * (high - min(max(value, low), high)) / (high - low)

    def x(i: float) -> float:
        return 1000.0 * (i + 0.5) / len(strides)

    stretched, fixed = [], []
    for i, j, m in _runs(strides, _block):
        word = _block(m)
        if word:
            left, width = x(i - 0.5), x(j + 0.5) - x(i - 0.5)
            stretched.append(
                f'<rect class="fb-block" x="{_f(left)}" width="{_f(width)}" y="0" height="1000"/>'
            )
            if width >= NARROW:
                fixed.append(_text(f"{_f((left + width / 2) / 10)}%", inner + 14, word, "words", "middle"))
    for i, j, m in _runs(strides, lambda m: (m.cue.zone_low, m.cue.zone_high)):
        top, bottom = y(m.cue.zone_high), y(m.cue.zone_low)
        stretched.append(
            f'<rect class="band" x="{_f(x(i - 0.5))}" width="{_f(x(j + 0.5) - x(i - 0.5))}" y="{_f(top)}" '
            f'height="{_f(bottom - top)}"/>'
        )
    for tick in _ticks(low, high):
        at = _f(y(tick))
        stretched.append(f'<line class="g" x1="0" x2="1000" y1="{at}" y2="{at}"/>')
        digits = max(0, -math.floor(math.log10(_step(low, high)) + 1e-9))
        fixed.append(_text("0", y(tick) * inner / 1000, number(tick, digits), "", "end", dx=-7, dy=4))
    mean = content.target.mean
    if mean is not None and low <= mean <= high:
        at = _f(y(mean))
        stretched.append(f'<line class="nm" x1="0" x2="1000" y1="{at}" y2="{at}"/>')
    for i, m in enumerate(strides):
        css = f"{'fb-on' if m.cue.with_feedback else 'fb-off'} {KEY[m.cue.side]}"
        fixed.append(
            f'<svg x="{_f(x(i) / 10)}%" y="{_f(y(m.value) * inner / 1000)}" overflow="visible" width="1" '
            f'height="1"><circle class="{css}" r="2.6"/></svg>'
        )
    for i, j, m in _runs(strides, lambda m: (_opens(m), m.cue.level)):
        if not _opens(m) and x(j + 0.5) - x(i - 0.5) >= NARROW:
            word = f"level {m.cue.level}"
            fixed.append(_text(f"{_f(x(i - 0.5) / 10)}%", inner + 28, word, "words", "start"))
    title = f"{term.label} of every stride over the zone of its level; the table has the numbers"
    return (
        f'<div class="chart fb-plot"><svg width="100%" height="{inner}" overflow="visible" role="img">'
        f"<title>{escape(title)}</title>"
        '<svg viewBox="0 0 1000 1000" preserveAspectRatio="none" width="100%" height="100%" '
        f'overflow="hidden">{"".join(stretched)}</svg>{"".join(fixed)}</svg></div>'
    )


def _opens(m: MatchedStride) -> bool:
    """The stride is of the block a visit begins with, which may have no level yet."""
    return m.cue.why_not in {"baseline", "retention"}


def _block(m: MatchedStride) -> str:
    """Word of a block without feedback, "" in training."""
    why = m.cue.why_not
    if why == "baseline":
        return "before"
    return why if why in {"probe", "retention"} else ""


def _runs(
    strides: Sequence[MatchedStride], key: Callable[[MatchedStride], object]
) -> Iterator[tuple[int, int, MatchedStride]]:
    """First and last number of strides in a row with the same key, and the first of them."""
    start = 0
    for _, group in groupby(strides, key):
        found = list(group)
        yield start, start + len(found) - 1, found[0]
        start += len(found)


def _range(strides: Sequence[MatchedStride], content: Prescription) -> tuple[float, float]:
    """Ends of the value axis: zones and values, but not what lies far off."""
    low = min(m.cue.zone_low for m in strides)
    high = max(m.cue.zone_high for m in strides)
    width = (content.target.sd or 0.0) * content.progression.sd_per_level or (high - low)
    values = [m.value for m in strides]
    low, high = min(low, max(min(values), low - FAR * width)), max(high, min(max(values), high + FAR * width))
    room = 0.06 * (high - low) or 1.0
    return low - room, high + room


def _step(low: float, high: float) -> float:
    raw = (high - low) / TICKS
    power: float = 10.0 ** math.floor(math.log10(raw))
    return next(f * power for f in (1, 2, 5, 10) if f * power >= raw)


def _ticks(low: float, high: float) -> list[float]:
    step = _step(low, high)
    return [step * i for i in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _text(x: str, y: float, text: str, css: str, anchor: str, dx: int = 0, dy: int = 0) -> str:
    return (
        f'<text class="{css}" x="{x}" y="{_f(y)}" dx="{dx}" dy="{dy}" text-anchor="{anchor}">'
        f"{escape(text)}</text>"
    )


def _f(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")
