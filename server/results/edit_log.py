"""Edits of an analysis: append-only rows, including those for undoing.

Repeating the edit that was undone last is a redo and preserves the redo history; any other edit clears it.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from sqlalchemy import Connection, bindparam, select

from sagittal.core.events.edits import Edit, read_edit
from sagittal.server.storage.schema.tables import edit as rows
from sagittal.server.storage.schema.tables import user

UNDO: Final = "undo"
"""Kind of the row that undoes the last edit in effect."""


@dataclass(frozen=True)
class MadeEdit:
    """An edit in effect, with author and time."""

    seq: int
    edit: Edit
    by: str | None
    at: dt.datetime


@dataclass(frozen=True)
class EditHistory:
    """The edits in effect of an analysis, oldest first.

    Parameters
    ----------
    version : number of the last row, including undone ones; 0 = never edited.
    changed_at : time of that row, None = never edited.
    undone : edits that can be redone, the next one last.
    """

    version: int = 0
    made: tuple[MadeEdit, ...] = ()
    changed_at: dt.datetime | None = None
    undone: tuple[Edit, ...] = ()

    @property
    def edits(self) -> tuple[Edit, ...]:
        """The edits without author and time."""
        return tuple(m.edit for m in self.made)

    def changed_after(self, moment: dt.datetime) -> bool:
        """Whether an edit was made or undone after a given time."""
        return self.changed_at is not None and self.changed_at > moment

    @property
    def key(self) -> tuple[int, ...]:
        """Equal keys denote equal edits: undoing an edit restores the previous key."""
        return tuple(m.seq for m in self.made)


def edits_of(c: Connection, analysis_id: str) -> EditHistory:
    """The edits in effect of an analysis."""
    return edits_of_all(c, [analysis_id])[analysis_id]


_OF_ALL: Final = (
    select(rows, user.c.display_name)
    .join(user, user.c.id == rows.c.user_id, isouter=True)
    .where(rows.c.analysis_id.in_(bindparam("analysis_ids", expanding=True)))
    .order_by(rows.c.seq)
)


def edits_of_all(c: Connection, analysis_ids: Collection[str]) -> dict[str, EditHistory]:
    """The edits in effect of many analyses, by analysis, in one statement."""
    by_analysis: dict[str, list[MadeEdit]] = {analysis_key: [] for analysis_key in analysis_ids}
    undone: dict[str, list[Edit]] = {analysis_key: [] for analysis_key in by_analysis}
    version = dict.fromkeys(by_analysis, 0)
    changed_at: dict[str, dt.datetime] = {}
    for row in c.execute(_OF_ALL, {"analysis_ids": list(by_analysis)}) if by_analysis else ():
        version[row.analysis_id], changed_at[row.analysis_id] = row.seq, row.at
        live, stack = by_analysis[row.analysis_id], undone[row.analysis_id]
        if row.kind == UNDO:
            stack.append(live.pop().edit)
            continue
        edit = read_edit(row.content)
        if stack and stack[-1] == edit:
            stack.pop()
        else:
            stack.clear()
        live.append(MadeEdit(row.seq, edit, row.display_name, row.at))
    return {
        analysis_key: EditHistory(
            version[analysis_key], tuple(live), changed_at.get(analysis_key), tuple(undone[analysis_key])
        )
        for analysis_key, live in by_analysis.items()
    }
