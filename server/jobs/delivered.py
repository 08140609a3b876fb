"""Jobs on PostgreSQL: procrastinate delivers their ids to idle workers on any computer.

An id is deferred in the transaction that queues the job, so it is delivered after the commit. The job table
remains authoritative: a delivery only triggers a look at the table, a duplicate has no effect, and a lost one
is covered by slow polling.
"""

from __future__ import annotations

import asyncio
import logging
import queue
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

import psycopg
import psycopg_pool
from procrastinate import App, PsycopgConnector
from procrastinate.exceptions import ConnectorException
from procrastinate.jobs import Status
from sqlalchemy import Connection, func, select

from sagittal.server.jobs.queue import Wait
from sagittal.server.jobs.table import TableQueue
from sagittal.server.storage.postgres import APPLICATION, DELIVERY_SCHEMA

log = logging.getLogger(__name__)

QUEUE: Final = "jobs"
DELIVER: Final = "deliver"
SLOW_POLL_S: Final = 5.0
"""Maximum interval at which an idle worker polls the table, and once per lease."""
RETRY_S: Final = 2.0
"""Pause before a broken connection to PostgreSQL is retried."""
PATIENCE_S: Final = 5.0
"""Time limit for connecting before the connection is recreated."""
STOP_S: Final = 0.2
"""Maximum time for an idle worker to notice that it should stop."""
FORGET: Final = "*/10 * * * *"
"""When deliveries to killed workers are removed (cron)."""


class DeliveredQueue(TableQueue):
    """TableQueue with deliveries, for PostgreSQL databases."""

    _sender = App(connector=PsycopgConnector())

    @contextmanager
    def listen(self) -> Iterator[Wait]:
        """See JobQueue."""
        line = DeliveryLine(str(self._db.source), min(SLOW_POLL_S, self._lease.total_seconds()))
        line.start()
        try:
            yield line.wait
        finally:
            line.close()

    def _announce(self, c: Connection, job_id: str) -> None:
        path = c.execute(select(func.current_setting("search_path"))).scalar_one()
        c.execute(select(func.set_config("search_path", DELIVERY_SCHEMA, True)))
        raw = c.connection.driver_connection
        self._sender.configure_task(DELIVER, queue=QUEUE, connection=raw).defer(job_id=job_id)
        c.execute(select(func.set_config("search_path", path, True)))


class DeliveryLine:
    """Thread that runs procrastinate's worker; it accepts one delivery and holds it until the next wait.

    A busy worker therefore accepts no delivery that an idle one could process.

    Parameters
    ----------
    poll_s : maximum wait without a delivery, s.
    """

    def __init__(self, url: str, poll_s: float) -> None:
        self._poll_s = poll_s
        self._inbox: queue.Queue[str] = queue.Queue()
        self._held = False
        self._closed = threading.Event()
        self._app = self._build_app(url)
        self._running: asyncio.Task[None] | None = None
        self._thread = threading.Thread(target=self._run, name="deliveries", daemon=True)

    def start(self) -> None:
        """Start accepting deliveries."""
        self._thread.start()

    def wait(self, stop: threading.Event) -> None:
        """Release the last delivery; return at the next one, after the polling interval, or to stop."""
        self._let_go()
        until = time.monotonic() + self._poll_s
        while not stop.is_set() and time.monotonic() < until:
            with suppress(queue.Empty):
                self._inbox.get(timeout=STOP_S)
                self._held = True
                return

    def close(self) -> None:
        """End the thread; accepted but unstarted jobs are picked up by another worker's polling."""
        self._closed.set()
        cancelled = None
        while self._thread.is_alive():
            running = self._running
            if running is not None and running is not cancelled:
                cancelled = running
                with suppress(RuntimeError):  # its loop has just ended
                    running.get_loop().call_soon_threadsafe(running.cancel)
            self._let_go()
            with suppress(queue.Empty):
                self._inbox.get(timeout=STOP_S)
                self._held = True

    def _let_go(self) -> None:
        if self._held:
            self._held = False
            self._inbox.task_done()

    def _build_app(self, url: str) -> App:
        connector = PsycopgConnector(
            conninfo=url,
            min_size=1,
            max_size=2,
            timeout=PATIENCE_S,
            kwargs={"application_name": APPLICATION, "options": f"-c search_path={DELIVERY_SCHEMA}"},
        )
        app = App(connector=connector)

        @app.task(name=DELIVER, queue=QUEUE)
        def _deliver(job_id: str) -> None:
            if not self._closed.is_set():
                self._inbox.put(job_id)
                self._inbox.join()

        @app.periodic(cron=FORGET)
        @app.task(name="forget_lost", queue=QUEUE)
        async def _forget_lost(timestamp: int) -> None:
            for lost in await app.job_manager.get_stalled_jobs(queue=QUEUE):
                with suppress(ConnectorException):  # another worker was faster
                    await app.job_manager.finish_job(lost, Status.FAILED, delete_job=True)

        return app

    def _run(self) -> None:
        while not self._closed.is_set():
            try:
                asyncio.run(self._attend())
            except asyncio.CancelledError:
                return
            except (ConnectorException, psycopg.Error, psycopg_pool.PoolTimeout, OSError):
                log.warning("deliveries of jobs: no line to PostgreSQL, trying again", exc_info=True)
            self._closed.wait(RETRY_S)

    async def _attend(self) -> None:
        self._running = asyncio.create_task(self._take())
        try:
            await self._running
        finally:
            self._running = None

    async def _take(self) -> None:
        try:  # not as a context manager: a pool cancelled while opening has tasks that only closing ends
            await self._app.open_async()
            await self._app.run_worker_async(
                queues=[QUEUE],
                concurrency=1,
                fetch_job_polling_interval=self._poll_s,
                delete_jobs="always",
                install_signal_handlers=False,
            )
        finally:
            await self._app.close_async()
