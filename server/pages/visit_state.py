"""What a list says of a visit: a shape and a word."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from server.services import analyses, edit_log, sessions
from server.services.reviewed import UNREADABLE, ReviewedAnalyses

STATES: Final[Mapping[str, tuple[str, str]]] = {
    "empty": ("none", "No recording yet"),
    "uploaded": ("warn", "Check sensors"),
    "running": ("run", "Analysing"),
    "done": ("ok", "Analysed"),
    "failed": ("bad", "Not analysable"),
}
"""State of a session → shape and word."""


def describe_state(state: str) -> dict[str, str]:
    """Shape and word of a session's state."""
    kind, text = STATES[state]
    return {"kind": kind, "text": text}


def judge_visit(
    reviewed: ReviewedAnalyses,
    s: sessions.Session,
    shown: analyses.AnalysisRecord | None,
    edits: Mapping[str, edit_log.EditHistory],
) -> dict[str, str]:
    """What a list says of a session: of one that is analysed how good its data are, as its own page does."""
    if s.state != "done" or shown is None or "analysis.json" not in shown.files:
        return describe_state(s.state)
    try:
        kind, text = reviewed.read_verdict(shown, edits[shown.id])
    except UNREADABLE:
        kind, text = "bad", "Cannot be read"
    return {"kind": kind, "text": text}
