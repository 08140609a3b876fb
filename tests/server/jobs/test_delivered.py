"""Jobs are delivered on PostgreSQL: no test here could end in time by the slow poll of the job table."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import closing

import pytest

from sagittal.server.jobs import delivered
from sagittal.server.jobs.opening import open_queue
from sagittal.server.jobs.queue import Claim, Wait
from sagittal.server.jobs.table import TableQueue
from sagittal.server.storage.db import Database
from tests.helpers.postgres import run_sql

pytestmark = pytest.mark.postgres

NEVER_S = 1e5
PATIENCE_S = 60.0


class Office:
    """Queue whose table is read only after a delivery."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.db = Database(url)
        self.queue: TableQueue = open_queue(self.db, NEVER_S)

    def close(self) -> None:
        self.db.close()

    def submit(self, key: str) -> str:
        with self.db.write() as c:
            return self.queue.submit(c, key=key, kind="k", params={}).id

    def wait_and_claim(self, wait: Wait) -> Claim:
        stop = threading.Event()
        alarm = threading.Timer(PATIENCE_S, stop.set)
        alarm.start()
        wait(stop)
        alarm.cancel()
        assert not stop.is_set(), "nothing was delivered"
        claim = self.queue.claim("w", ("k",))
        assert claim is not None
        return claim

    def listeners(self) -> set[int]:
        message = (
            "SELECT pid FROM pg_stat_activity WHERE datname = current_database() AND query LIKE 'LISTEN%'"
        )
        return {pid for (pid,) in run_sql(message, self.url)}

    def await_listeners(self, count: int, reference: frozenset[int] = frozenset()) -> None:
        limit = time.monotonic() + PATIENCE_S
        while len(self.listeners() - reference) < count:
            assert time.monotonic() < limit
            time.sleep(0.05)

    def undelivered(self) -> int:
        return int(run_sql("SELECT count(*) FROM procrastinate.procrastinate_jobs", self.url)[0][0])


@pytest.fixture
def office(postgres: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Office]:
    monkeypatch.setattr(delivered, "SLOW_POLL_S", NEVER_S)
    with closing(Office(postgres)) as connection:
        yield connection


def test_idle_workers_are_told_of_jobs_and_a_busy_one_takes_no_delivery(office: Office) -> None:
    initial = office.submit("before anybody listened")
    with office.queue.listen() as wait:
        assert office.wait_and_claim(wait).job_id == initial
        with office.queue.listen() as wait_beside:
            office.await_listeners(2)
            second = office.submit("while the first works")
            selection = office.wait_and_claim(wait_beside)
            assert selection.job_id == second
            assert office.undelivered() == 2  # held until their workers wait again
        office.await_listeners(1)
        assert office.queue.release(selection)
        repeat = office.wait_and_claim(wait)
        assert (repeat.job_id, repeat.attempt) == (second, 2)
    assert office.undelivered() == 0


def test_a_job_that_was_not_committed_is_not_delivered(office: Office) -> None:
    with office.db.write() as c:
        office.queue.submit(c, key="a", kind="k", params={})
        c.rollback()
    assert office.undelivered() == 0


def test_a_broken_line_is_mended(office: Office) -> None:
    with office.queue.listen() as wait:
        office.await_listeners(1)
        reference = frozenset(office.listeners())
        run_sql(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
            "WHERE datname = current_database() AND pid <> pg_backend_pid()",
            office.url,
        )
        office.await_listeners(1, reference)
        job_id = office.submit("after it")
        assert office.wait_and_claim(wait).job_id == job_id


def test_a_worker_that_is_told_to_stop_waits_no_longer(office: Office) -> None:
    stop = threading.Event()
    stop.set()
    with office.queue.listen() as wait:
        wait(stop)
    assert office.undelivered() == 0
