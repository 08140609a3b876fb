"""Status of a visit in lists: symbol and word."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from sagittal.server.clinic import sessions
from sagittal.server.live_takes import live
from sagittal.server.results import analyses, edit_log
from sagittal.server.results.reviewed import UNREADABLE, ReviewedAnalyses

STATES: Final[Mapping[str, tuple[str, str]]] = {
    "empty": ("none", "No recording yet"),
    "uploaded": ("warn", "Check sensors"),
    "running": ("run", "Analysing"),
    "done": ("ok", "Analysed"),
    "failed": ("bad", "Not analysable"),
}
"""State of a session → symbol and word."""


LIVE_STATES: Final[Mapping[str, tuple[str, str]]] = {
    "pairing": ("none", "Waiting for the tablet"),
    "open": ("none", "Waiting for the tablet"),
    "streaming": ("run", "Live now"),
}
"""State of a running live trial → symbol and word."""


def describe_live(take: live.LiveTakeRecord) -> dict[str, str]:
    """Session, symbol and word of a running live trial."""
    kind, text = LIVE_STATES[take.state]
    return {"session": take.session_id, "kind": kind, "text": text}


def describe_state(state: str) -> dict[str, str]:
    """Symbol and word of a session's state."""
    kind, text = STATES[state]
    return {"kind": kind, "text": text}


def judge_visit(
    reviewed: ReviewedAnalyses,
    s: sessions.Session,
    record: analyses.AnalysisRecord | None,
    edits: Mapping[str, edit_log.EditHistory],
) -> dict[str, str]:
    """Status of a session in lists: data quality if analysed, as on its own page."""
    if s.state != "done" or record is None or "analysis.json" not in record.files:
        return describe_state(s.state)
    try:
        kind, text = reviewed.read_verdict(record, edits[record.id])
    except UNREADABLE:
        kind, text = "bad", "Cannot be read"
    return {"kind": kind, "text": text}
