"""Resources that the web process opens at start and closes at the end."""

from __future__ import annotations

import asyncio
import contextlib
import datetime as dt
import logging
import os
import signal
import time
from collections.abc import AsyncIterator, Callable
from functools import partial
from typing import cast

from fastapi import FastAPI

from sagittal.server.auth.sessions import Logins
from sagittal.server.auth.throttle import SharedFailures, Throttle
from sagittal.server.context import State
from sagittal.server.jobs.feed import JobFeed
from sagittal.server.jobs.opening import open_queue
from sagittal.server.live.hub import Hub
from sagittal.server.live_takes.films import FilmIntake
from sagittal.server.metrics import StateCollector
from sagittal.server.nodes.registry import Nodes
from sagittal.server.processes.supervisor import Workers
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import custody, erasure
from sagittal.server.safekeeping.custody import refuse_strangers
from sagittal.server.settings import Settings
from sagittal.server.sharing import report_links
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_opening import open_blobs
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.storage.high_water import MarkKeeper
from sagittal.server.storage.migrate import upgrade
from sagittal.server.storage.readiness import Readiness
from sagittal.server.trail import AuditTrail

log = logging.getLogger(__name__)


def _look_after(db: Database, blobs: BlobStore, settings: Settings) -> None:
    """Finish interrupted erasures and log a warning if this database cannot be trusted."""
    erasure.finish(db, blobs, settings)
    with db.read() as c:
        doubted = custody.find_doubt(c, settings)
        orphaned = report_links.list_orphaned(c)
    if orphaned:  # created by accounts closed before links ended with them
        with db.write() as c:
            report_links.end_orphaned(c, None)
    if doubted is not None:
        log.warning("%s No stored file is taken away meanwhile; see `sagittal check`.", doubted)


def _end_at_once() -> None:
    """Exit immediately without writing to disk: another process owns the files of this one."""
    os.kill(os.getpid(), signal.SIGKILL)


def _say_workers(state: State) -> str:
    """Status of the worker processes started by `sagittal serve`; other workers are not monitored."""
    workers: Workers | None = getattr(state, "workers", None)
    if workers is None or workers.healthy:
        return "ok"
    return f"{len(workers.pids)} of {state.settings.workers} worker processes run; see the server's log."


def _say_estimators(state: State) -> str:
    living, configured = len(state.hub.pool.pids), state.settings.live_workers
    if living >= configured:
        return "ok"
    return f"{living} of {configured} estimator processes run; see the server's log."


@contextlib.asynccontextmanager
async def run_installation(app: FastAPI) -> AsyncIterator[None]:
    """Open database, files, queue and live trials of `app.state.settings` for the duration of the context."""
    state = cast("State", app.state)
    settings = state.settings
    refuse_strangers(settings)
    upgrade(settings.database_source, backups=settings.backups)
    db = Database(settings.database_source)
    state.db = db
    state.blobs = open_blobs(settings)
    state.reviewed = ReviewedAnalyses(state.blobs)
    await asyncio.to_thread(_look_after, db, state.blobs, settings)
    state.trail = AuditTrail(db)
    state.queue = open_queue(db, settings.lease_s)
    state.feed = JobFeed(db)
    state.throttle = Throttle(time.time, SharedFailures(db)) if settings.node_name else Throttle()
    state.logins = Logins(
        db, dt.timedelta(minutes=settings.idle_minutes), dt.timedelta(hours=settings.absolute_hours)
    )
    keeper = MarkKeeper(db, settings.mark)
    keeper.start()
    state.films = FilmIntake(settings, db, state.blobs)
    state.nodes = Nodes(settings, db, _end_at_once)
    await asyncio.to_thread(state.nodes.start)
    state.hub = Hub(settings, db, state.reviewed, state.queue, state.nodes)
    await state.hub.start()
    parts: dict[str, Callable[[], str]] = {
        "workers": partial(_say_workers, state),
        "estimators": partial(_say_estimators, state),
    }
    if settings.node_name:
        parts["node"] = state.nodes.explain_silence
    state.readiness = Readiness(settings, db, state.blobs, parts=parts)
    figures = StateCollector(settings, db, state.readiness.checks, state.nodes)
    state.metrics.registry.register(figures)
    try:
        async with state.trail.run():
            yield
    finally:
        state.metrics.registry.unregister(figures)
        await state.hub.stop()
        state.films.close()
        state.feed.close()
        await asyncio.to_thread(state.nodes.stop)
        await asyncio.to_thread(keeper.stop)
        db.close()
