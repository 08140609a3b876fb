"""What the hub reads and writes in the database; everything here blocks and is called in a thread."""

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
    """The rows of live takes."""

    def __init__(self, db: Database, reviewed: ReviewedAnalyses) -> None:
        self._db, self._reviewed = db, reviewed

    def claim(self, row: live.LiveTakeRecord, owner: live.TakeOwner) -> live.LiveTakeRecord:
        """Have a take from now on; raises NodeAway, NotFound."""
        if owner.node is None and row.node is None:
            return row  # one server alone: nothing to write
        with self._db.write() as c:
            return claim_take(c, row.id, owner)

    def takes(self, take_ids: Collection[str]) -> dict[str, live.LiveTakeRecord]:
        """Those of these takes that are still there."""
        with self._db.read() as c:
            return live.find_many(c, take_ids)

    def admit(self, take_id: str, token: str) -> live.LiveTakeRecord | None:
        """The take a token opens, over or not."""
        with self._db.read() as c:
            return live.by_token(c, take_id, token)

    def take(self, take_id: str) -> live.LiveTakeRecord:
        """One take; raises NotFound."""
        with self._db.read() as c:
            return live.get(c, take_id)

    def current(self, session_id: str) -> live.LiveTakeRecord | None:
        """The session's newest take."""
        with self._db.read() as c:
            return live.current(c, session_id)

    def open_take(self, session_id: str) -> live.LiveTakeRecord:
        """The session's open take; raises NotFound, Conflict no_open_take."""
        with self._db.read() as c:
            return live.require_open(c, session_id)

    def prepare(self, row: live.LiveTakeRecord) -> tuple[LiveTraining, list[live_events.LiveEvent]]:
        """What a take is coached with, and what happened in it so far."""
        training = training_of(self._db, self._reviewed, row)
        with self._db.read() as c:
            return training, live_events.events(c, row.id)

    def keep_command(
        self, actor: audit.Actor | None, take_id: str, kind: str, t_s: float | None, content: object
    ) -> None:
        """Append what a person did."""
        with self._db.write() as c:
            live_events.add_event(c, actor, take_id, kind, t_s, content)

    def start(self, take_id: str, source: str) -> None:
        """Note the first batch; a take that was erased meanwhile is none."""
        with contextlib.suppress(NotFound), self._db.write() as c:
            live.note_start(c, take_id, source)

    def end(self, actor: audit.Actor | None, take_id: str, state: str, end: TakeEnd) -> live.LiveTakeRecord:
        """End a take; raises NotFound when it was erased meanwhile."""
        with self._db.write() as c:
            return live.end(
                c, actor, take_id, state, count=end.count, sha256=end.sha256 or None, problem=end.problem
            )


def claim_take(c: Connection, take_id: str, owner: live.TakeOwner) -> live.LiveTakeRecord:
    """Note that this start of a web server has a take from now on; raises NotFound, NodeAway.

    What a later start of it has claimed stays that one's.
    """
    this = live.get(c, take_id)
    owner.require(this)
    if owner.node is not None and this.node_run is not None and this.node_run > (owner.run or 0):
        raise NodeAway(this.node)
    mine = live_take.c.id == take_id
    c.execute(update(live_take).where(mine).values(node=owner.node, node_run=owner.run))
    return live.get(c, take_id)
