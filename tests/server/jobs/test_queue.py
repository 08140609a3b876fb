"""The contract of a JobQueue, one case at a time and as a state machine against a model."""

from __future__ import annotations

import datetime as dt
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from sqlalchemy import select

from sagittal.server.jobs.opening import open_queue
from sagittal.server.jobs.queue import Claim, JobView, LeaseState, Priority
from sagittal.server.jobs.table import MAX_DEATHS
from sagittal.server.storage.db import Database, Source
from sagittal.server.storage.schema.tables import job
from tests.helpers.databases import write_database

LEASE_S = 15.0


class Clock:
    def __init__(self) -> None:
        self.time = dt.datetime(2026, 3, 29, 0, 55, tzinfo=dt.UTC)

    def __call__(self) -> dt.datetime:
        return self.time

    def advance(self, seconds: float) -> None:
        self.time += dt.timedelta(seconds=seconds)


class Bench:
    """Queue with a controllable clock and its published results."""

    def __init__(self, source: Source) -> None:
        self.db = Database(source)
        self.clock = Clock()
        self.queue = open_queue(self.db, LEASE_S, self.clock)
        self.published: list[tuple[str, int]] = []

    def submit(self, key: str, **more: Any) -> JobView:
        with self.db.write() as c:
            return self.queue.submit(c, key=key, kind="k", params={"n": 1}, **more)

    def claim(self, worker: str = "w") -> Claim:
        claim = self.queue.claim(worker, ("k",))
        assert claim is not None
        return claim

    def claim_again(self, claim: Claim) -> Claim:
        """Next worker's claim after this one returned the job."""
        assert self.queue.release(claim)
        return self.claim()

    def finish(self, claim: Claim) -> bool:
        return self.queue.finish(claim, lambda c: self.published.append((claim.job_id, claim.attempt)))

    def cancel(self, job_id: str) -> JobView | None:
        with self.db.write() as c:
            return self.queue.cancel(c, job_id)

    def state(self, job_id: str) -> str:
        view = self.queue.get(job_id)
        assert view is not None
        return view.state

    def attempt(self, job_id: str) -> int:
        view = self.queue.get(job_id)
        assert view is not None
        return view.attempt


@pytest.fixture
def bench(source: Source) -> Iterator[Bench]:
    result = Bench(source)
    yield result
    result.db.close()


def test_the_same_key_is_one_job_until_it_fails(bench: Bench) -> None:
    first = bench.submit("a")
    assert bench.submit("a").id == first.id
    claim = bench.claim()
    assert bench.submit("a").id == first.id
    bench.queue.fail(claim, "no_walking", "No walking.")
    repeat = bench.submit("a")
    assert repeat.id != first.id
    assert bench.finish(bench.claim())
    assert bench.submit("a").id == repeat.id


def test_a_job_that_is_being_cancelled_does_not_answer_for_a_new_wish(bench: Bench) -> None:
    first = bench.submit("a")
    claim = bench.claim()
    bench.cancel(first.id)
    repeat = bench.submit("a")
    assert repeat.id != first.id
    assert bench.queue.heartbeat(claim) is LeaseState.LOST
    assert not bench.finish(claim)


def test_the_important_one_first_then_the_oldest(bench: Bench) -> None:
    ids = [bench.submit("a").id, bench.submit("b").id, bench.submit("c", priority=Priority.IN_FRONT).id]
    assert [bench.claim().job_id for _ in ids] == [ids[2], ids[0], ids[1]]
    assert bench.queue.claim("w", ("k",)) is None


def test_a_worker_takes_only_kinds_it_knows(bench: Bench) -> None:
    bench.submit("a")
    assert bench.queue.claim("w", ("other",)) is None


def test_a_checkpoint_goes_to_the_next_attempt_and_forgives_deaths(bench: Bench) -> None:
    view = bench.submit("a")
    first = bench.claim()
    assert first.checkpoint is None
    for _ in range(2 * MAX_DEATHS):
        assert bench.queue.note_death(first)
        first = bench.claim()
        bench.queue.keep(first, f"{first.attempt:064}", lambda c: None)
    second = bench.claim_again(first)
    assert second.checkpoint == f"{first.attempt:064}"
    assert bench.queue.keep(second, "f" * 64, lambda c: None) == second.checkpoint
    assert bench.queue.keep(second, "f" * 64, lambda c: None) is None
    # whoever lost the claim is told that nothing refers to what was stored
    assert bench.queue.keep(first, "e" * 64, lambda c: None) == "e" * 64
    assert bench.finish(second)
    with bench.db.read() as c:
        assert c.execute(select(job.c.checkpoint).where(job.c.id == view.id)).scalar_one() is None


def test_a_job_behind_makes_way_for_any_other(bench: Bench) -> None:
    bench.submit("long", priority=Priority.BEHIND)
    claim = bench.claim()
    bench.submit("as long", priority=Priority.BEHIND)
    assert bench.queue.look(claim) is LeaseState.OURS
    urgent = bench.submit("urgent")
    assert bench.queue.look(claim) is LeaseState.YIELD
    assert bench.queue.heartbeat(claim) is LeaseState.YIELD
    bench.cancel(claim.job_id)
    assert bench.queue.look(claim) is LeaseState.CANCEL
    assert bench.claim().job_id == urgent.id


def test_a_job_without_checkpoints_is_worked_to_its_end(bench: Bench) -> None:
    bench.submit("analysis")
    claim = bench.claim()
    bench.submit("somebody waits", priority=Priority.IN_FRONT)
    assert bench.queue.look(claim) is LeaseState.OURS
    assert bench.queue.heartbeat(claim) is LeaseState.OURS


def test_a_renewed_lease_is_not_taken_an_expired_one_is(bench: Bench) -> None:
    bench.submit("a")
    first = bench.claim("one")
    for _ in range(4):
        bench.clock.advance(LEASE_S * 0.9)
        assert bench.queue.heartbeat(first) is LeaseState.OURS
        assert bench.queue.claim("two", ("k",)) is None
    bench.clock.advance(LEASE_S * 1.1)
    second = bench.claim("two")
    assert (second.job_id, second.attempt) == (first.job_id, 2)


@pytest.mark.parametrize("taker", ["one", "two"])
def test_every_write_of_a_lost_claim_is_refused(bench: Bench, taker: str) -> None:
    bench.submit("a")
    lost = bench.claim("one")
    bench.clock.advance(LEASE_S * 1.1)
    bench.claim(taker)
    initial_response = bench.queue.get(lost.job_id)
    assert bench.queue.heartbeat(lost) is LeaseState.LOST
    assert not bench.queue.progress(lost, "angles", 0.5)
    assert not bench.finish(lost)
    assert not bench.queue.fail(lost, "x", "y")
    assert not bench.queue.stop(lost)
    assert not bench.queue.note_death(lost)
    assert not bench.queue.release(lost)
    assert bench.queue.get(lost.job_id) == initial_response
    assert bench.published == []


def test_a_result_that_cannot_be_published_leaves_the_job_running(bench: Bench) -> None:
    view = bench.submit("a")
    claim = bench.claim()

    def broken(_: object) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        bench.queue.finish(claim, broken)
    assert bench.state(view.id) == "running"
    assert bench.finish(claim)


def test_after_a_request_to_cancel_there_is_no_result(bench: Bench) -> None:
    view = bench.submit("a")
    claim = bench.claim()
    assert bench.cancel(view.id) is not None
    assert bench.queue.heartbeat(claim) is LeaseState.CANCEL
    assert not bench.finish(claim)
    assert bench.queue.stop(claim)
    assert bench.state(view.id) == "cancelled"


def test_a_queued_job_is_cancelled_at_once_and_a_finished_one_stays(bench: Bench) -> None:
    view = bench.submit("a")
    assert bench.cancel(view.id).state == "cancelled"  # type: ignore[union-attr]
    done = bench.submit("b")
    bench.finish(bench.claim())
    assert bench.cancel(done.id).state == "done"  # type: ignore[union-attr]
    assert bench.cancel("0" * 32) is None


def test_a_cancelled_job_whose_worker_died_is_not_run_again(bench: Bench) -> None:
    view = bench.submit("a")
    bench.claim()
    bench.cancel(view.id)
    bench.clock.advance(LEASE_S * 1.1)
    assert bench.queue.claim("two", ("k",)) is None
    assert bench.state(view.id) == "cancelled"


@pytest.mark.parametrize("way", ["expired", "reported"])
def test_three_deaths_end_a_job_and_a_release_is_none(bench: Bench, way: str) -> None:
    view = bench.submit("a")
    for _ in range(5):
        claim = bench.claim()
        assert bench.attempt(view.id) == 1
        assert bench.queue.release(claim)
        assert bench.attempt(view.id) == 0
    for _ in range(MAX_DEATHS):
        claim = bench.claim()
        if way == "expired":
            bench.clock.advance(LEASE_S * 1.1)
        else:
            assert bench.queue.note_death(claim)
    assert bench.queue.claim("w", ("k",)) is None
    final_response = bench.queue.get(view.id)
    assert final_response is not None
    assert (final_response.state, final_response.error_code) == ("failed", "worker_died")


def test_a_clock_set_back_an_hour_does_not_keep_a_dead_workers_job(bench: Bench) -> None:
    view = bench.submit("a")
    bench.claim("one")
    bench.clock.advance(-3600)
    assert bench.claim("two").job_id == view.id


class QueueModel(RuleBasedStateMachine):
    """Workers that beat, freeze, crash and finish in any order; at most one result per key, and it stays."""

    @initialize()
    def open(self) -> None:
        self.folder = Path(tempfile.mkdtemp())
        write_database(self.folder / "a.db")
        self.bench = Bench(self.folder / "a.db")
        self.claims: list[Claim] = []
        self.ended: dict[str, str] = {}

    def teardown(self) -> None:
        self.bench.db.close()
        shutil.rmtree(self.folder)

    @rule(key=st.sampled_from("ab"))
    def submit(self, key: str) -> None:
        self.bench.submit(key)

    @rule(worker=st.sampled_from(["one", "two"]))
    def claim(self, worker: str) -> None:
        claim = self.bench.queue.claim(worker, ("k",))
        if claim is not None:
            assert all((c.job_id, c.attempt) != (claim.job_id, claim.attempt) for c in self.claims)
            self.claims.append(claim)

    @rule(seconds=st.sampled_from([1.0, LEASE_S * 0.6, LEASE_S * 1.1, -3600.0]))
    def let_time_pass(self, seconds: float) -> None:
        self.bench.clock.advance(seconds)

    @rule(
        data=st.data(),
        what=st.sampled_from(["finish", "fail", "died", "release", "beat", "progress", "stop"]),
    )
    def act(self, data: st.DataObject, what: str) -> None:
        if not self.claims:
            return
        claim = data.draw(st.sampled_from(self.claims))
        newest = max(c.attempt for c in self.claims if c.job_id == claim.job_id)
        queue = self.bench.queue
        match what:
            case "finish":
                ok = self.bench.finish(claim)
            case "fail":
                ok = queue.fail(claim, "x", "y")
            case "died":
                ok = queue.note_death(claim)
            case "release":
                ok = queue.release(claim)
            case "beat":
                ok = queue.heartbeat(claim) is not LeaseState.LOST
            case "progress":
                ok = queue.progress(claim, "s", 0.5)
            case _:
                ok = queue.stop(claim)
        assert not ok or claim.attempt == newest  # nobody acts on a claim that was followed by another

    @rule(data=st.data())
    def cancel(self, data: st.DataObject) -> None:
        with self.bench.db.read() as c:
            ids = list(c.execute(job.select().with_only_columns(job.c.id).order_by(job.c.seq)).scalars())
        if ids:
            self.bench.cancel(data.draw(st.sampled_from(ids)))

    @invariant()
    def one_result_and_ends_are_final(self) -> None:
        with self.bench.db.read() as c:
            rows = c.execute(job.select()).all()
        done = [row for row in rows if row.state == "done"]
        assert len({row.key for row in done}) == len(done)
        assert sorted(i for i, _ in self.bench.published) == sorted(row.id for row in done)
        for job_id, state in self.ended.items():
            assert any(row.id == job_id and row.state == state for row in rows)
        self.ended = {row.id: row.state for row in rows if row.finished_at is not None}


TestQueueModel = pytest.mark.slow(QueueModel.TestCase)
TestQueueModel.settings = settings(
    max_examples=25,
    stateful_step_count=25,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)
