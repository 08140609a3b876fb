"""Layout of the first printed page: optional content that fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from typing import Any, Final

from sagittal.server.sharing.signed_reports import ASSESSMENT_CHARACTERS

MOST_PARAGRAPHS: Final = 3
MOST_BARS: Final = 6
MOST_LINES: Final = 13
"""Maximum lines of note and headline with ten rows, three curves and the profile below."""

MOST_LINES_COMPARED: Final = 6
"""Likewise with a column of changes, which narrows the others so that rows need two lines."""

HALF: Final = 48
"""English characters per line of half a page; leaves room for the longer German text."""


def has_room_for_profile(report: Mapping[str, Any], assessment: str, note: str) -> bool:
    """Whether the movement profile fits on the first page, next to the therapist's text.

    Counts lines for the widest font and the longest language.
    """
    headline = report["headline"]
    if headline is None or report["score"] is None or len(report["bars"]) > MOST_BARS:
        return False
    standing = [s.marked for s in headline.shown]
    changed = [s.marked for s in headline.shown_changes] if report["since"] else []
    left_out = ["; ".join(headline.standouts_left)]
    left_changes = ["; ".join(f"{c.title} {c.side or ''} {c.size}" for c in headline.changes_left)]
    columns = (
        _count_lines(standing) + _count_lines(left_out),
        _count_lines(changed) + (_count_lines(left_changes) + 1 if report["since"] else 0),
    )
    noted = ceil(len(note) / (2 * HALF))
    if report["trend"] is not None and (report["trend"].missing or report["trend"].later):
        noted += 1
    return (
        len(assessment) <= ASSESSMENT_CHARACTERS  # earlier versions were longer, over the full width
        and assessment.strip().count("\n") < 2 * MOST_PARAGRAPHS
        and max(columns) + noted <= (MOST_LINES_COMPARED if report["since"] else MOST_LINES)
    )


def _count_lines(texts: Sequence[str]) -> int:
    return sum(ceil(len(text) / HALF) for text in texts)
