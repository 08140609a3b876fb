"""Database access of the hub; all functions block and are called in threads."""

from __future__ import annotations

import contextlib
from collections.abc import Collection

from sqlalchemy import Connection, update

from sagittal.server import audit
from sagittal.server.errors import NodeAway, NotFound
from sagittal.server.live.intake import TakeEnd
from sagittal.server.live_takes import live, live_events
from sagittal.server.live_takes.live_training import LiveTraining, training_of
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.live_tables import live_take


class Rows:
    """Database rows of live trials."""

    def __init__(self, db: Database, reviewed: ReviewedAnalyses) -> None:
        self._db, self._reviewed = db, reviewed

    def claim(self, row: live.LiveTakeRecord, owner: live.TakeOwner) -> live.LiveTakeRecord:
        """Take ownership of a trial; raises NodeAway, NotFound."""
        if owner.node is None and row.node is None:
            return row  # single server: nothing to write
        with self._db.write() as c:
            return claim_take(c, row.id, owner)

    def takes(self, take_ids: Collection[str]) -> dict[str, live.LiveTakeRecord]:
        """Those of these trials that still exist."""
        with self._db.read() as c:
            return live.find_many(c, take_ids)

    def admit(self, take_id: str, token: str) -> live.LiveTakeRecord | None:
        """The trial with this token, ended or not."""
        with self._db.read() as c:
            return live.by_token(c, take_id, token)

    def take(self, take_id: str) -> live.LiveTakeRecord:
        """One trial; raises NotFound."""
        with self._db.read() as c:
            return live.get(c, take_id)

    def current(self, session_id: str) -> live.LiveTakeRecord | None:
        """The session's latest trial."""
        with self._db.read() as c:
            return live.current(c, session_id)

    def open_take(self, session_id: str) -> live.LiveTakeRecord:
        """The session's open trial; raises NotFound, Conflict no_open_take."""
        with self._db.read() as c:
            return live.require_open(c, session_id)

    def prepare(self, row: live.LiveTakeRecord) -> tuple[LiveTraining, list[live_events.LiveEvent]]:
        """Training parameters of a trial, and its events so far."""
        training = training_of(self._db, self._reviewed, row)
        with self._db.read() as c:
            return training, live_events.events(c, row.id)

    def keep_command(
        self, actor: audit.Actor | None, take_id: str, kind: str, t_s: float | None, content: object
    ) -> None:
        """Append a user's command."""
        with self._db.write() as c:
            live_events.add_event(c, actor, take_id, kind, t_s, content)

    def start(self, take_id: str, source: str) -> None:
        """Record the first batch; no effect if the trial has been erased."""
        with contextlib.suppress(NotFound), self._db.write() as c:
            live.note_start(c, take_id, source)

    def end(self, actor: audit.Actor | None, take_id: str, state: str, end: TakeEnd) -> live.LiveTakeRecord:
        """End a trial; raises NotFound if it has been erased."""
        with self._db.write() as c:
            return live.end(
                c, actor, take_id, state, count=end.count, sha256=end.sha256 or None, problem=end.problem
            )


def claim_take(c: Connection, take_id: str, owner: live.TakeOwner) -> live.LiveTakeRecord:
    """Assign a trial to this run of a web server; raises NotFound, NodeAway.

    A claim by a later run of the same server takes precedence.
    """
    this = live.get(c, take_id)
    owner.require(this)
    if owner.node is not None and this.node_run is not None and this.node_run > (owner.run or 0):
        raise NodeAway(this.node)
    mine = live_take.c.id == take_id
    c.execute(update(live_take).where(mine).values(node=owner.node, node_run=owner.run))
    return live.get(c, take_id)
