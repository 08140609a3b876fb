"""What people change in a finished analysis: edits kept in order, undone by a row too, measured at once.

A stored analysis never changes. Its edits are rows; the events, strides and parameters that count are
measured from its tracks and the live edits, by the function that the pipeline ends with. Two people may
review one session: who edits says which state was seen (`version`), and any but the newest is refused.
"""

from __future__ import annotations

import datetime as dt
import threading
from collections import OrderedDict
from collections.abc import Callable, Collection, Hashable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from sqlalchemy import Connection, insert, select

from core.edits import Edit, edit_of
from core.measure import Measured, Tracks, measure
from core.norms.controls import ControlSession
from core.parameters.rows import Column
from server import audit
from server.report import signals, tracks
from server.report.bundle import Bundle, load_bundle, read_columns, reviewed
from server.report.numbers import Numbers, numbers_of, read_numbers
from server.services import analyses
from server.services.errors import Conflict
from server.storage.blobs import BlobStore
from server.storage.db import Database
from server.storage.tables import edit as rows
from server.storage.tables import now, user

_Value = TypeVar("_Value")

UNDO: Final = "undo"
NOT_READ: Final = ("poses.parquet", signals.NAME)
"""Files that only the replay and the drawing of signals need."""

TAKES_KEPT, RESULTS_KEPT, PARTS_KEPT, NUMBERS_KEPT, CONTROLS_KEPT, VERDICTS_KEPT = 3, 12, 24, 240, 500, 5000
"""Finished analyses, results of edits, signals of one sensor and numbers kept in memory: those at work. Ten
minutes are some 20 MB, 1 MB, 2 MB and 50 kB; a verdict is two words."""

ACTIONS: Final = {
    "move_event": "event.moved",
    "add_event": "event.added",
    "delete_event": "event.deleted",
    "exclude_stride": "stride.left_out",
    "include_stride": "stride.counted",
    UNDO: "edit.undone",
}
"""Kind of a row → its action in the audit trail."""


@dataclass(frozen=True)
class MadeEdit:
    """A live edit: who made it, and when."""

    seq: int
    edit: Edit
    by: str | None
    at: dt.datetime


@dataclass(frozen=True)
class Edits:
    """The edits of an analysis that count, oldest first.

    Parameters
    ----------
    version : number of the last row, undone ones included; 0 = nothing was ever changed.
    """

    version: int = 0
    made: tuple[MadeEdit, ...] = ()

    @property
    def edits(self) -> tuple[Edit, ...]:
        """What was changed."""
        return tuple(m.edit for m in self.made)

    @property
    def key(self) -> tuple[int, ...]:
        """Equal keys are equal edits: undoing one leads back to the key before."""
        return tuple(m.seq for m in self.made)


@dataclass(frozen=True, eq=False)
class Take:
    """A finished analysis in memory; one without `tracks`, of an earlier version, cannot be edited."""

    bundle: Bundle
    tracks: Tracks | None

    @property
    def fixed_because(self) -> str | None:
        """Why nothing of it can be edited, None where it can."""
        if self.tracks is not None:
            return None
        stopped = next((n.message for n in self.bundle.warnings if n.severity == "error"), None)
        if stopped is not None:
            return f"The analysis stopped before events were looked for. {stopped}"
        return (
            "This analysis was made by an earlier version, which did not keep what an edit is measured on. "
            "Run the analysis again."
        )


def edits_of(c: Connection, analysis_id: str) -> Edits:
    """The live edits of an analysis."""
    return edits_of_all(c, [analysis_id])[analysis_id]


def edits_of_all(c: Connection, analysis_ids: Collection[str]) -> dict[str, Edits]:
    """The live edits of many analyses by analysis, in one statement."""
    query = (
        select(rows, user.c.display_name)
        .join(user, user.c.id == rows.c.user_id, isouter=True)
        .where(rows.c.analysis_id.in_(analysis_ids))
        .order_by(rows.c.seq)
    )
    made: dict[str, list[MadeEdit]] = {found: [] for found in analysis_ids}
    version = dict.fromkeys(made, 0)
    for row in c.execute(query) if made else ():
        version[row.analysis_id] = row.seq
        if row.kind == UNDO:
            made[row.analysis_id].pop()
        else:
            made[row.analysis_id].append(MadeEdit(row.seq, edit_of(row.content), row.display_name, row.at))
    return {found: Edits(version[found], tuple(live)) for found, live in made.items()}


def take(blobs: BlobStore, found: analyses.Analysis) -> Take:
    """A finished analysis, read once while it is at work; raises IntegrityError."""

    def read() -> Take:
        names = [name for name in found.files if name not in NOT_READ]
        files = {name: analyses.file_bytes(blobs, found, name) for name in names}
        stored = load_bundle(files)
        if tracks.NAME not in files:
            return Take(stored, None)
        return Take(stored, tracks.read_tracks(files[tracks.NAME], stored.events, stored.angles))

    return _takes.get(found.id, read)


def measured(blobs: BlobStore, found: analyses.Analysis, edits: Edits) -> Measured | None:
    """What the live edits give; None without an edit: then the stored analysis counts."""
    if not edits.made:
        return None
    return _results.get((found.id, edits.key), lambda: _measure(blobs, found, edits.edits))


def columns(blobs: BlobStore, found: analyses.Analysis, edits: Edits) -> Mapping[str, Column]:
    """Figures of every stride of the list as they count, by parameter; raises IntegrityError."""
    result = measured(blobs, found, edits)
    if result is not None:
        return result.columns
    return (
        read_columns(analyses.file_bytes(blobs, found, "strides.csv")) if "strides.csv" in found.files else {}
    )


def bundle(blobs: BlobStore, found: analyses.Analysis, edits: Edits) -> Bundle:
    """The analysis with what its live edits give; raises IntegrityError."""
    stored, result = take(blobs, found).bundle, measured(blobs, found, edits)
    return stored if result is None else reviewed(stored, result, edits.edits)


def numbers(blobs: BlobStore, found: analyses.Analysis, edits: Edits) -> Numbers:
    """Parameters and scores as they count; without an edit no signal is read; raises IntegrityError."""

    def read() -> Numbers:
        if not edits.made:
            stored = read_numbers(analyses.file_bytes(blobs, found, "analysis.json"))
            if stored is not None:
                return stored
        return numbers_of(bundle(blobs, found, edits))

    return _numbers.get((found.id, edits.key), read)


def verdict(blobs: BlobStore, found: analyses.Analysis, edits: Edits) -> tuple[str, str]:
    """Shape and word for the data of an analysis, as lists show it; raises IntegrityError."""
    return _verdicts.get((found.id, edits.key), lambda: numbers(blobs, found, edits).verdict)


def kept(key: tuple[str, ...], make_value: Callable[[], _Value]) -> _Value:
    """A part of a finished analysis that is looked at again and again, by a key that begins with its id."""
    value: _Value = _parts.get(key, make_value)
    return value


def control(
    found: analyses.Analysis, edits: Edits, make_value: Callable[[], ControlSession]
) -> ControlSession:
    """What serves as reference of a finished analysis of a control."""
    return _controls.get((found.id, edits.key), make_value)


def forget() -> None:
    """Keep nothing in memory: what is erased on disk must not stay here."""
    for memory in (_takes, _results, _numbers, _controls, _parts, _verdicts):
        memory.clear()


def make(
    db: Database,
    blobs: BlobStore,
    actor: audit.Actor | None,
    session_id: str,
    edit: Edit,
    *,
    seen: int | None = None,
) -> tuple[analyses.Analysis, Edits]:
    """Change the analysis that a session shows.

    Parameters
    ----------
    seen : version on which the person decided; None = whatever there is.

    Raises
    ------
    NotFound: no analysis. Conflict: edited_meanwhile, no_tracks. ParameterError of core.edits.
    """
    found, before = _state(db, session_id, seen)
    # measured before the lock is taken: what cannot be is refused, and nobody waits for it
    result = _measure(blobs, found, (*before.edits, edit))
    with db.write() as c:
        _refuse_older(c, found, before)
        _append(c, actor, session_id, found, edit.kind, edit.to_json())
        after = edits_of(c, found.id)
    _results.put((found.id, after.key), result)
    return found, after


def undo(
    db: Database, actor: audit.Actor | None, session_id: str, *, seen: int | None = None
) -> tuple[analyses.Analysis, Edits]:
    """Take the last live edit back; raises NotFound, Conflict nothing_to_undo, edited_meanwhile."""
    found, before = _state(db, session_id, seen)
    if not before.made:
        raise Conflict("nothing_to_undo", "Nothing has been changed in this analysis.")
    with db.write() as c:
        _refuse_older(c, found, before)
        _append(c, actor, session_id, found, UNDO, {})
        return found, edits_of(c, found.id)


def _state(db: Database, session_id: str, seen: int | None) -> tuple[analyses.Analysis, Edits]:
    with db.read() as c:
        found = analyses.shown(c, session_id)
        edits = edits_of(c, found.id)
    if seen is not None and seen != edits.version:
        raise _meanwhile()
    return found, edits


def _refuse_older(c: Connection, found: analyses.Analysis, before: Edits) -> None:
    if edits_of(c, found.id).version != before.version:
        raise _meanwhile()


def _meanwhile() -> Conflict:
    return Conflict(
        "edited_meanwhile",
        "Somebody else has changed this review since it was loaded; nothing was changed. Load it again.",
    )


def _append(
    c: Connection,
    actor: audit.Actor | None,
    session_id: str,
    found: analyses.Analysis,
    kind: str,
    content: dict[str, Any],
) -> None:
    values = {
        "analysis_id": found.id,
        "kind": kind,
        "content": content,
        "user_id": actor.user_id if actor else None,
        "at": now(),
    }
    c.execute(insert(rows).values(values))
    # the reason is free text and stays out of a trail that outlives an erasure
    said = {k: v for k, v in content.items() if k != "reason"}
    audit.record(c, actor, ACTIONS[kind], "session", session_id, {"analysis_id": found.id, **said})


def _measure(blobs: BlobStore, found: analyses.Analysis, edits: tuple[Edit, ...]) -> Measured:
    known = take(blobs, found)
    if known.tracks is None:
        raise Conflict("no_tracks", known.fixed_because or "")
    return measure(known.tracks, edits)


class _Kept(Generic[_Value]):
    """The values used last."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._values: OrderedDict[Hashable, _Value] = OrderedDict()
        self._lock = threading.Lock()

    def clear(self) -> None:
        with self._lock:
            self._values.clear()

    def get(self, key: Hashable, make_value: Callable[[], _Value]) -> _Value:
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
        value = make_value()
        self.put(key, value)
        return value

    def put(self, key: Hashable, value: _Value) -> None:
        with self._lock:
            self._values[key] = value
            self._values.move_to_end(key)
            while len(self._values) > self._size:
                self._values.popitem(last=False)


_takes: _Kept[Take] = _Kept(TAKES_KEPT)
_results: _Kept[Measured] = _Kept(RESULTS_KEPT)
_numbers: _Kept[Numbers] = _Kept(NUMBERS_KEPT)
_controls: _Kept[ControlSession] = _Kept(CONTROLS_KEPT)
_verdicts: _Kept[tuple[str, str]] = _Kept(VERDICTS_KEPT)
_parts: _Kept[Any] = _Kept(PARTS_KEPT)
