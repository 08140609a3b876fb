"""Embedded queue: the job table, claimed by the workers of `sagittal serve`.

A job whose worker crashes three times fails, so that a malformed recording cannot loop. A lease far in the
future is treated as expired, since the clock was set back; fencing makes a wrong decision harmless.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from sqlalchemy import ColumnElement, Connection, and_, insert, or_, select, update

from sagittal.server.jobs.queue import (
    VIEW_COLUMNS,
    Claim,
    JobView,
    LeaseState,
    Priority,
    Publish,
    Wait,
    job_view,
)
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import ACTIVE_STATES, job, new_id, now

POLL_S = 0.2
"""Polling interval; a poll is one index read."""
MAX_DEATHS = 3
"""Number of worker crashes after which a job fails."""

POISONED = (
    f"worker died {MAX_DEATHS} times on this job without a word: it may need more memory than allowed, or "
    "the recording breaks a library. Try fewer or shorter files; the server's log has the signal."
)

_CLAIMED = tuple(
    job.c[k] for k in ("id", "attempt", "kind", "recording_id", "requested_by", "params", "checkpoint")
)


class TableQueue:
    """JobQueue on the job table.

    Parameters
    ----------
    lease_s : time without renewal after which a claim expires.
    clock : returns the current UTC time, replaced in tests.
    """

    def __init__(self, db: Database, lease_s: float, clock: Callable[[], dt.datetime] = now) -> None:
        self._db = db
        self._lease = dt.timedelta(seconds=lease_s)
        self._clock = clock

    def submit(
        self,
        c: Connection,
        *,
        key: str,
        kind: str,
        params: Mapping[str, Any],
        recording_id: str | None = None,
        requested_by: str | None = None,
        priority: Priority = Priority.USUAL,
    ) -> JobView:
        """See JobQueue."""
        same = and_(job.c.key == key, job.c.state.in_((*ACTIVE_STATES, "done")), ~job.c.cancel_requested)
        row = c.execute(select(*VIEW_COLUMNS).where(same)).first()
        if row:
            return job_view(row)
        # a job being cancelled still holds the key, but is not the one requested now
        c.execute(
            update(job)
            .where(job.c.key == key, job.c.state.in_(ACTIVE_STATES))
            .values(**self._ended("cancelled"))
        )
        values = {
            "id": new_id(),
            "key": key,
            "kind": kind,
            "recording_id": recording_id,
            "requested_by": requested_by,
            "params": dict(params),
            "priority": priority,
            "state": "queued",
            "attempt": 0,
            "deaths": 0,
            "cancel_requested": False,
            "created_at": self._clock(),
        }
        view = job_view(c.execute(insert(job).values(values).returning(*VIEW_COLUMNS)).one())
        self._announce(c, view.id)
        return view

    def get(self, job_id: str) -> JobView | None:
        """See JobQueue."""
        rows = self._db.ask(select(*VIEW_COLUMNS).where(job.c.id == job_id))
        return job_view(rows[0]) if rows else None

    def cancel(self, c: Connection, job_id: str) -> JobView | None:
        """See JobQueue."""
        mine = job.c.id == job_id
        c.execute(update(job).where(mine, job.c.state == "running").values(cancel_requested=True))
        c.execute(
            update(job)
            .where(mine, job.c.state == "queued")
            .values(cancel_requested=True, **self._ended("cancelled"))
        )
        row = c.execute(select(*VIEW_COLUMNS).where(mine)).first()
        return job_view(row) if row else None

    def claim(self, worker: str, kinds: Collection[str]) -> Claim | None:
        """See JobQueue; an idle worker only reads, so it does not block writers."""
        time = self._clock()
        claimable = and_(job.c.state == "queued", job.c.kind.in_(kinds))
        if not self._db.ask(select(job.c.seq).where(or_(claimable, self._dead(time))).limit(1)):
            return None
        with self._db.write() as c:
            self._bury(c, self._dead(time))
            first = (
                select(job.c.seq)
                .where(claimable)
                .order_by(job.c.priority, job.c.seq)
                .limit(1)
                .with_for_update(skip_locked=True)
                .scalar_subquery()
            )
            claimed = (
                update(job)
                .where(job.c.seq == first)
                .values(
                    state="running",
                    attempt=job.c.attempt + 1,
                    worker=worker,
                    lease_until=time + self._lease,
                    started_at=time,
                    stage=None,
                    fraction=None,
                    message=None,
                )
                .returning(*_CLAIMED)
            )
            row = c.execute(claimed).first()
        if row is None:
            return None
        job_id, attempt, *claim_values = row
        return Claim(job_id, attempt, worker, *claim_values)

    def heartbeat(self, claim: Claim) -> LeaseState:
        """See JobQueue."""
        return (
            self.look(claim)
            if self._fenced(claim, lease_until=self._clock() + self._lease)
            else LeaseState.LOST
        )

    def look(self, claim: Claim) -> LeaseState:
        """See JobQueue."""
        rows = self._db.ask(select(job.c.cancel_requested, job.c.priority).where(_fence(claim)))
        if not rows:
            return LeaseState.LOST
        [row] = rows
        if row.cancel_requested:
            return LeaseState.CANCEL
        if row.priority < Priority.BEHIND:
            return LeaseState.OURS  # it has no checkpoints, so its work would be lost
        urgent = select(job.c.seq).where(job.c.state == "queued", job.c.priority < row.priority).limit(1)
        return LeaseState.YIELD if self._db.ask(urgent) else LeaseState.OURS

    def progress(self, claim: Claim, stage: str, fraction: float, message: str | None = None) -> bool:
        """See JobQueue."""
        share = min(max(fraction, 0.0), 1.0)
        return self._fenced(claim, stage=stage[:64], fraction=share, message=message and message[:500])

    def keep(self, claim: Claim, sha256: str, require: Publish) -> str | None:
        """See JobQueue."""
        with self._db.write() as c:
            old = c.execute(select(job.c.checkpoint).where(_fence(claim))).first()
            if old is None:
                return sha256
            require(c)
            c.execute(update(job).where(_fence(claim)).values(checkpoint=sha256, deaths=0))
            return None if old.checkpoint == sha256 else old.checkpoint

    def finish(self, claim: Claim, publish: Publish) -> bool:
        """See JobQueue."""
        with self._db.write() as c:
            ours = and_(_fence(claim), ~job.c.cancel_requested)
            if c.execute(update(job).where(ours).values(**self._ended("done"), fraction=1.0)).rowcount != 1:
                return False
            publish(c)
        return True

    def fail(self, claim: Claim, code: str, message: str) -> bool:
        """See JobQueue."""
        return self._fenced(claim, **self._ended("failed"), error_code=code[:64], error_message=message)

    def stop(self, claim: Claim) -> bool:
        """See JobQueue."""
        return self._fenced(claim, **self._ended("cancelled"))

    def note_death(self, claim: Claim) -> bool:
        """See JobQueue."""
        with self._db.write() as c:
            return self._bury(c, _fence(claim)) == 1

    def release(self, claim: Claim) -> bool:
        """See JobQueue."""
        with self._db.write() as c:
            free = {
                "state": "queued",
                "worker": None,
                "lease_until": None,
                "released": job.c.released + 1,
            }
            if c.execute(update(job).where(_fence(claim)).values(**free)).rowcount != 1:
                return False
            self._announce(c, claim.job_id)
        return True

    @contextmanager
    def listen(self) -> Iterator[Wait]:
        """See JobQueue; polls the table."""
        yield lambda stop: stop.wait(POLL_S)

    def _announce(self, c: Connection, job_id: str) -> None:
        """Notify idle workers of a queued job on commit; a no-op here, since they poll."""

    def _fenced(self, claim: Claim, **values: object) -> bool:
        with self._db.write() as c:
            return c.execute(update(job).where(_fence(claim)).values(**values)).rowcount == 1

    def _ended(self, state: str) -> dict[str, object]:
        ended = {"state": state, "worker": None, "lease_until": None, "finished_at": self._clock()}
        return {**ended, "checkpoint": None}

    def _dead(self, time: dt.datetime) -> ColumnElement[bool]:
        expired = or_(job.c.lease_until < time, job.c.lease_until > time + 2 * self._lease)
        return and_(job.c.state == "running", expired)

    def _bury(self, c: Connection, which: ColumnElement[bool]) -> int:
        """Count a crash of running jobs: cancel if requested, fail at the third, otherwise requeue."""
        buried = 0
        for row in c.execute(select(job.c.seq, job.c.deaths, job.c.cancel_requested).where(which)).all():
            values: dict[str, object] = {"deaths": row.deaths + 1}
            if row.cancel_requested:
                values |= self._ended("cancelled")
            elif row.deaths + 1 >= MAX_DEATHS:
                values |= self._ended("failed")
                values |= {"error_code": "worker_died", "error_message": POISONED}
            else:
                values |= {"state": "queued", "worker": None, "lease_until": None}
            c.execute(update(job).where(job.c.seq == row.seq).values(**values))
            buried += 1
        return buried


def _fence(claim: Claim) -> ColumnElement[bool]:
    return and_(
        job.c.id == claim.job_id,
        job.c.attempt == claim.attempt,
        job.c.worker == claim.worker,
        job.c.state == "running",
    )
