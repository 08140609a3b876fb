"""Crash-safe steps after the end of a live trial is on disk.

Mark the row as ended, store the log as a recording, notify the tablet, wait for the estimator's last results,
remove the log (services/live_recordings.py completes pending steps at the next start).
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from typing import Final

from sagittal.server import audit
from sagittal.server.errors import NotFound
from sagittal.server.jobs.queue import JobQueue
from sagittal.server.live import protocol
from sagittal.server.live.intake import TakeEnd
from sagittal.server.live.journal import Journal
from sagittal.server.live.pool import EstimatorPool
from sagittal.server.live.protocol import CloseCode
from sagittal.server.live.rows import Rows
from sagittal.server.live.take import ActiveTake
from sagittal.server.live_takes import live, live_recordings
from sagittal.server.settings import Settings
from sagittal.server.storage import fs
from sagittal.server.storage.db import Database
from sagittal.server.storage.disk_log import DiskLog
from sagittal.server.storage.files.blobs import BlobStore

log = logging.getLogger(__name__)

DRAIN_S: Final = 10.0
"""Time limit for the estimator's remaining results at the end of a trial."""
AGAIN_S: Final = 30.0
"""Pause before storing a trial is retried (disk full)."""


class Ending:
    """Live trials in the process of ending.

    Parameters
    ----------
    over : called with the row of an ended trial.
    """

    def __init__(
        self,
        settings: Settings,
        db: Database,
        blobs: BlobStore,
        queue: JobQueue,
        rows: Rows,
        journal: Journal,
        pool: EstimatorPool,
        over: Callable[[live.LiveTakeRecord], None],
    ) -> None:
        self._keep = (db, blobs, queue)
        self._disk = DiskLog(log)
        self._settings = settings
        self._rows = rows
        self._journal, self._pool, self._over = journal, pool, over
        self._asked: dict[str, audit.Actor | None] = {}
        self._draining: dict[str, ActiveTake] = {}

    def ask(self, take: ActiveTake, actor: audit.Actor | None) -> None:
        """Register a user (None: the program) who ends this trial here instead of on the tablet."""
        self._asked[take.id] = actor

    def unask(self, take: ActiveTake) -> None:
        """Withdraw the request, since the trial could not be ended."""
        del self._asked[take.id]

    def draining(self, take_id: str) -> ActiveTake | None:
        """An ended trial whose estimator still delivers results."""
        return self._draining.get(take_id)

    async def refuse_erased(self, take: ActiveTake) -> None:
        """Raise NotFound and remove the log if the trial was erased just before its log was created."""
        try:
            await asyncio.to_thread(self._rows.take, take.id)
        except NotFound:
            await take.recorder.close()
            await asyncio.to_thread(fs.remove_file, take.recorder.path)
            raise

    async def complete(self, take: ActiveTake, end: TakeEnd, forget: Callable[[], None]) -> None:
        """Carry out all steps; `forget` is called once the trial has ended in the database."""
        is_local = take.id in self._asked
        actor = self._asked.pop(take.id, None)
        try:
            with contextlib.suppress(NotFound):
                await asyncio.to_thread(self._journal.write)
                state = "closed" if is_local else "finished"
                await asyncio.to_thread(self._rows.end, actor, take.id, state, end)
            self._draining[take.id] = take
            forget()
            await take.recorder.close()
            take.problem = end.problem
            take.recording_id = await self._store(take.id)
            self._tell(take, is_local)
            with contextlib.suppress(NotFound):
                self._over(await asyncio.to_thread(self._rows.take, take.id))
            take.over.set()
            await self._drain(take)
            # before the log is removed: a late estimator then sees an ended trial, not a lost one
            self._pool.leave(take.id)
            path = live_recordings.log_path(self._settings.live, take.id)
            await asyncio.to_thread(fs.remove_file, path)
        finally:
            take.over.set()
            self._draining.pop(take.id, None)
            self._pool.leave(take.id)

    def _tell(self, take: ActiveTake, is_local: bool) -> None:
        if take.tablet is None:
            return
        if take.recording_id is not None:
            take.tablet.say(protocol.announce_finish(take.recording_id, take.problem))
        if is_local or take.recording_id is None:
            take.tablet.shut(CloseCode.ENDED, "take_ended")

    async def _store(self, take_id: str) -> str | None:
        """Retry until the log is stored, as it contains acknowledged samples."""
        path = live_recordings.log_path(self._settings.live, take_id)
        while True:
            try:
                recording_id = await asyncio.to_thread(live_recordings.keep, *self._keep, path)
            except Exception as error:  # noqa: BLE001 - logged, whatever it is
                self._disk.note_refusal(error, f"live take {take_id}")
            else:
                self._disk.note_success()
                return recording_id
            await asyncio.sleep(AGAIN_S)

    async def _drain(self, take: ActiveTake) -> None:
        """Wait for the estimator's last strides and cues."""
        if self._pool.follows(take.id) and take.estimate != "failed":
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(DRAIN_S):
                    await take.told.wait()
