"""Job updates pushed to subscribers: one loop reads the database for all, so browsers do not poll.

feed = JobFeed(db)
async for view in feed.watch(job_id): ...     # the present state first, every change, ends when finished
"""

from __future__ import annotations

import asyncio
import logging
import sqlite3
from collections import defaultdict
from collections.abc import AsyncIterator, Collection

from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError

from sagittal.server.jobs.queue import VIEW_COLUMNS, JobView, job_view
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import job

log = logging.getLogger(__name__)

INTERVAL_S = 0.2
"""Polling interval; a poll without a change reads no table."""


class JobFeed:
    """In-process broadcaster; its loop runs while there are subscribers."""

    def __init__(self, db: Database) -> None:
        self._db = db
        self._watchers: defaultdict[str, set[asyncio.Queue[JobView | None]]] = defaultdict(set)
        self._loop: asyncio.Task[None] | None = None

    async def watch(self, job_id: str) -> AsyncIterator[JobView]:
        """Yield the job now and after every change, until it is finished or erased, or the feed closes."""
        mailbox: asyncio.Queue[JobView | None] = asyncio.Queue()
        self._watchers[job_id].add(mailbox)
        if self._loop is None or self._loop.done():
            self._loop = asyncio.create_task(self._run())
        try:
            last = (await asyncio.to_thread(self._read, {job_id})).get(job_id)
            while last is not None:
                yield last
                if last.finished:
                    return
                view = await mailbox.get()
                while view == last:
                    view = await mailbox.get()
                last = view
        finally:
            self._watchers[job_id].discard(mailbox)
            if not self._watchers[job_id]:
                del self._watchers[job_id]

    def close(self) -> None:
        """End all subscriptions, so that the server can stop."""
        for mailboxes in self._watchers.values():
            for mailbox in mailboxes:
                mailbox.put_nowait(None)

    async def _run(self) -> None:
        with self._db.watch() as changes:
            while self._watchers:
                try:
                    if await asyncio.to_thread(changes.has_changed):
                        watched = set(self._watchers)
                        self._deliver(watched, await asyncio.to_thread(self._read, watched))
                except (SQLAlchemyError, sqlite3.Error):
                    log.exception("job feed: will look again")
                await asyncio.sleep(INTERVAL_S)

    def _deliver(self, watched: Collection[str], views: dict[str, JobView]) -> None:
        for job_id in watched:
            for mailbox in self._watchers.get(job_id, ()):
                mailbox.put_nowait(views.get(job_id))

    def _read(self, job_ids: Collection[str]) -> dict[str, JobView]:
        with self._db.read() as c:
            rows = c.execute(select(*VIEW_COLUMNS).where(job.c.id.in_(job_ids))).all()
        return {row.id: job_view(row) for row in rows}
