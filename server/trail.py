"""Audit rows for read access and denied access, which have no transaction of their own.

    trail.opened(who, "report.opened", "session", sid)    # one row per call
    trail.watched(who, "signals.opened", "session", sid)  # for repeated requests of a page

Reading must remain possible while the disk is not writable: rows are then queued in memory, each with its
time and a log line, and written in order before the next row. When the queue is full, reads are refused.
"""

from __future__ import annotations

import asyncio
import contextlib
import datetime as dt
import logging
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from sqlalchemy.exc import SQLAlchemyError

from sagittal.server import audit
from sagittal.server.storage.db import Database
from sagittal.server.storage.refusal import refusal_of
from sagittal.server.storage.schema.tables import now

log = logging.getLogger(__name__)

QUIET_S: Final = 15 * 60.0
"""Minimum interval of audit rows for repeated access, per sign-in, resource and kind."""
MOST_WAITING: Final = 10_000
"""Rows in memory while the disk is not writable, some 10 MB."""
MOST_REFUSED: Final = 100
"""Audit rows per hour about failed sign-ins: guessing for a year fills at most 400 MB."""
_HOUR_S: Final = 3600.0
_RETRY_S: Final = 30.0
_AT_ONCE: Final = 500
"""Rows per transaction, so that other writers get a turn."""
_MOST_WATCHED: Final = 10_000


class SignedIn(audit.Actor, Protocol):
    """A signed-in user and the sign-in of the request."""

    @property
    def login_id(self) -> str:
        """Primary key in `login_session`."""


@dataclass(frozen=True)
class _Row:
    actor: audit.Actor | None
    action: str
    resource: str
    resource_id: str | None
    detail: Mapping[str, Any]
    at: dt.datetime = field(default_factory=now)


class AuditTrail:
    """Writes access rows to the table `audit`; thread-safe.

    Parameters
    ----------
    db : the database. clock : monotonic seconds.
    """

    def __init__(self, db: Database, clock: Callable[[], float] = time.monotonic) -> None:
        self._db = db
        self._clock = clock
        self._turn = threading.Lock()  # held while rows are written
        self._guard = threading.Lock()  # held briefly
        self._waiting: deque[_Row] = deque()
        self._watched: dict[tuple[str, str, str | None], float] = {}
        self._refused: deque[float] = deque()
        self._uncounted = 0

    def record_opened(
        self,
        user: SignedIn,
        action: str,
        resource: str,
        resource_id: str | None,
        detail: Mapping[str, Any] | None = None,
    ) -> None:
        """Record that a user opens a resource, before it is shown.

        Raises
        ------
        OperationalError
            the queue for the disk is full, or the database is busy.
        """
        self._add(_Row(user, action, resource, resource_id, dict(detail or {})))

    def record_watched(
        self,
        user: SignedIn,
        action: str,
        resource: str,
        resource_id: str | None,
        detail: Mapping[str, Any] | None = None,
    ) -> None:
        """Record access once in QUIET_S for each sign-in, action and resource; raises like
        `record_opened`.
        """
        self._record_once(user.login_id, _Row(user, action, resource, resource_id, dict(detail or {})))

    def record_tried(self, user: audit.Actor, action: str, resource: str, resource_id: str) -> None:
        """Record denied access, once in QUIET_S for each account, action and resource.

        Does not raise for database errors: the response must not reveal that the resource exists.
        """
        with contextlib.suppress(SQLAlchemyError):
            self._record_once(user.user_id, _Row(user, action, resource, resource_id, {}))

    def _record_once(self, owner: str, row: _Row) -> None:
        key = (owner, row.action, row.resource_id)
        time = self._clock()
        with self._guard:
            if time - self._watched.get(key, -QUIET_S) < QUIET_S:
                return
            if len(self._watched) >= _MOST_WATCHED:
                self._watched = {k: t for k, t in self._watched.items() if time - t < QUIET_S}
        self._add(row)
        with self._guard:
            self._watched[key] = time

    def record_refused(self, action: str, resource: str, resource_id: str | None, address: str) -> None:
        """Record a failed sign-in from an address; does not raise for disk errors.

        The input is not stored, as users type passwords into the name field. At most MOST_REFUSED rows are
        written per hour; the next row gives the number of suppressed ones in `more`.
        """
        time = self._clock()
        with self._guard:
            while self._refused and self._refused[0] <= time - _HOUR_S:
                self._refused.popleft()
            if len(self._refused) >= MOST_REFUSED:
                self._uncounted += 1
                return
            self._refused.append(time)
            more, self._uncounted = self._uncounted, 0
        detail = {"address": address[:64]} | ({"more": more} if more else {})
        with contextlib.suppress(SQLAlchemyError):
            self._add(_Row(None, action, resource, resource_id, detail))

    def flush(self) -> bool:
        """Write the queued rows; return whether all are written. Raises errors other than disk failures."""
        self._is_refused()
        return not self._waiting

    @contextlib.asynccontextmanager
    async def run(self) -> AsyncIterator[None]:
        """Retry periodically while the context is active, and once more at its end."""
        retrying = asyncio.create_task(self._again())
        try:
            yield
        finally:
            retrying.cancel()
            await asyncio.gather(retrying, return_exceptions=True)
            with contextlib.suppress(SQLAlchemyError):
                await asyncio.to_thread(self.flush)
            if self._waiting:
                log.error("%d audit rows are in this log only: the disk refused them", len(self._waiting))

    async def _again(self) -> None:
        while True:
            await asyncio.sleep(_RETRY_S)
            if self._waiting:
                with contextlib.suppress(SQLAlchemyError):
                    await asyncio.to_thread(self.flush)

    def _add(self, row: _Row) -> None:
        if len(self._waiting) >= MOST_WAITING:
            self._write()
        self._waiting.append(row)
        try:
            is_refused = self._is_refused()
        except Exception:
            with self._turn, contextlib.suppress(ValueError):
                self._waiting.remove(row)
            raise
        if is_refused:
            name = row.actor.name if row.actor else None
            log.warning(
                "an audit row waits for room on the disk: %s %s %s by %s",
                row.action, row.resource, row.resource_id, name,
            )  # fmt: skip

    def _is_refused(self) -> bool:
        """Write the queued rows; return whether the disk refused. Raises other errors."""
        try:
            self._write()
        except Exception as error:
            if refusal_of(error) is None:
                raise
            return True
        return False

    def _write(self) -> None:
        """Write all rows in order; uncommitted rows remain queued."""
        with self._turn:
            while self._waiting:
                rows = [self._waiting[i] for i in range(min(len(self._waiting), _AT_ONCE))]
                with self._db.write() as c:
                    for row in rows:
                        audit.record(
                            c, row.actor, row.action, row.resource, row.resource_id, row.detail, time=row.at
                        )
                for _ in rows:
                    self._waiting.popleft()
