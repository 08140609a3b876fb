"""Table rows for strides with and without feedback."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from sagittal.core.feedback.cue import Summary
from sagittal.server.report.words.feedback_words import NBSP, format_quantity
from sagittal.server.report.words.wording import Term, format_number

NO_STRIDES: Final = "–"


@dataclass(frozen=True)
class FeedbackRow:
    """Strides of one kind; `text` is "0.52 ± 0.03", `zone` "65 %"; "–" if there are none."""

    kind: str
    label: str
    part: bool
    n: int
    mean: float | None
    sd: float | None
    in_zone: float | None
    text: str
    zone: str


def describe_summary(kind: str, label: str, part: bool, s: Summary, digits: int) -> FeedbackRow:
    """Format a summary as text."""
    text = NO_STRIDES
    if s.mean is not None:
        spread = "" if s.sd is None else f" ± {format_number(s.sd, digits)}"
        text = f"{format_number(s.mean, digits)}{spread}"
    zone = NO_STRIDES if s.in_zone is None else f"{format_number(100.0 * s.in_zone)}{NBSP}%"
    return FeedbackRow(kind, label, part, s.n, s.mean, s.sd, s.in_zone, text, zone)


def format_signed(value: float, term: Term) -> str:
    """A difference with its sign, unless it rounds to zero."""
    text = format_quantity(value, term)
    return f"+{text}" if value > 0 and float(f"{value:.{term.digits}f}") else text
