"""Edits of a finished analysis by users: logged in order, undoable, and applied immediately.

Two users may review the same session: each edit states the version it is based on (`version`), and any but
the latest is rejected.
"""

from __future__ import annotations

from typing import Any, Final

from sqlalchemy import Connection, insert

from sagittal.core.events.edits import Edit
from sagittal.server import audit
from sagittal.server.errors import Conflict
from sagittal.server.results import analyses
from sagittal.server.results.edit_log import UNDO, EditHistory, edits_of
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import edit as rows
from sagittal.server.storage.schema.tables import now

ACTIONS: Final = {
    "move_event": "event.moved",
    "add_event": "event.added",
    "delete_event": "event.deleted",
    "exclude_stride": "stride.left_out",
    "include_stride": "stride.counted",
    UNDO: "edit.undone",
}
"""Kind of a row → its action in the audit trail."""
REDONE: Final = "edit.redone"
"""Action of a redo."""


def make(
    db: Database,
    reviewed: ReviewedAnalyses,
    actor: audit.Actor | None,
    session_id: str,
    edit: Edit,
    *,
    base_version: int | None = None,
) -> tuple[analyses.AnalysisRecord, EditHistory]:
    """Edit the displayed analysis of a session.

    Parameters
    ----------
    base_version : version on which the edit is based; None = any.

    Raises
    ------
    NotFound: no analysis. Conflict: edited_meanwhile, no_tracks. ParameterError of
    sagittal.core.events.edits.
    """
    record, history = _state(db, session_id, base_version)
    return record, _make(db, reviewed, actor, session_id, record, history, edit, ACTIONS[edit.kind])


def undo(
    db: Database, actor: audit.Actor | None, session_id: str, *, base_version: int | None = None
) -> tuple[analyses.AnalysisRecord, EditHistory]:
    """Undo the last edit in effect; raises NotFound, Conflict nothing_to_undo, edited_meanwhile."""
    record, history = _state(db, session_id, base_version)
    if not history.made:
        raise Conflict("nothing_to_undo", "Nothing has been changed in this analysis.")
    with db.write() as c:
        _refuse_older(c, record, history)
        _append(c, actor, session_id, record, UNDO, {}, ACTIONS[UNDO])
        return record, edits_of(c, record.id)


def redo(
    db: Database,
    reviewed: ReviewedAnalyses,
    actor: audit.Actor | None,
    session_id: str,
    *,
    base_version: int | None = None,
) -> tuple[analyses.AnalysisRecord, EditHistory]:
    """Redo the last undone edit; raises NotFound, Conflict nothing_to_redo, edited_meanwhile."""
    record, history = _state(db, session_id, base_version)
    if not history.undone:
        raise Conflict("nothing_to_redo", "There is no undone change in this analysis.")
    return record, _make(db, reviewed, actor, session_id, record, history, history.undone[-1], REDONE)


def _make(
    db: Database,
    reviewed: ReviewedAnalyses,
    actor: audit.Actor | None,
    session_id: str,
    record: analyses.AnalysisRecord,
    history: EditHistory,
    edit: Edit,
    action: str,
) -> EditHistory:
    # computed before the lock is acquired: impossible edits are rejected without blocking others
    result = reviewed.measure_anew(record, (*history.edits, edit))
    with db.write() as c:
        _refuse_older(c, record, history)
        _append(c, actor, session_id, record, edit.kind, edit.to_json(), action)
        updated = edits_of(c, record.id)
    reviewed.keep_result(record, updated, result)
    return updated


def _state(
    db: Database, session_id: str, base_version: int | None
) -> tuple[analyses.AnalysisRecord, EditHistory]:
    with db.read() as c:
        record = analyses.get_shown(c, session_id)
        edits = edits_of(c, record.id)
    if base_version is not None and base_version != edits.version:
        raise _meanwhile()
    return record, edits


def _refuse_older(c: Connection, record: analyses.AnalysisRecord, history: EditHistory) -> None:
    if edits_of(c, record.id).version != history.version:
        raise _meanwhile()


def _meanwhile() -> Conflict:
    return Conflict(
        "edited_meanwhile",
        "Another user has changed this review since it was loaded; nothing was changed. Reload it.",
    )


def _append(
    c: Connection,
    actor: audit.Actor | None,
    session_id: str,
    analysis_record: analyses.AnalysisRecord,
    kind: str,
    content: dict[str, Any],
    action: str,
) -> None:
    values = {
        "analysis_id": analysis_record.id,
        "kind": kind,
        "content": content,
        "user_id": actor.user_id if actor else None,
        "at": now(),
    }
    c.execute(insert(rows).values(values))
    # the reason is free text and excluded from an audit trail that outlives an erasure
    fields = {k: v for k, v in content.items() if k != "reason"}
    audit.record(c, actor, action, "session", session_id, {"analysis_id": analysis_record.id, **fields})
