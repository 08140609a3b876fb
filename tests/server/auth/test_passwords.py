from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Connection, Engine, event

from sagittal.server.auth import passwords
from sagittal.server.auth.passwords import MAX_LENGTH, hash_password, verify_password
from sagittal.server.auth.throttle import (
    MAX_PER_ACCOUNT,
    MAX_PER_ADDRESS,
    MAX_PER_PAIR,
    WINDOW_S,
    FailuresInMemory,
    FailureStore,
    SharedFailures,
    Throttle,
)
from sagittal.server.http.problems import Problem
from sagittal.server.storage.db import Database
from tests.helpers.clinic import PASSWORD
from tests.helpers.databases import write_database


@pytest.mark.slow
def test_a_password_is_stored_as_argon2id_and_only_it_verifies() -> None:
    stored = hash_password(PASSWORD)
    assert stored.startswith("$argon2id$v=19$m=65536,t=3,p=4$")
    assert PASSWORD not in stored
    assert verify_password(PASSWORD, stored)
    assert not verify_password(PASSWORD + "x", stored)
    assert not verify_password(PASSWORD, "not a hash")


@pytest.mark.slow
def test_an_unknown_account_takes_as_long_as_a_wrong_password() -> None:
    def seconds(stored: str | None) -> float:
        start = time.perf_counter()
        assert not verify_password("wrong password", stored)
        return time.perf_counter() - start

    stored = hash_password(PASSWORD)
    known_smallest = min(seconds(stored) for _ in range(3))
    unknown = min(seconds(None) for _ in range(3))
    # without the dummy hash the ratio is below 0.001
    assert 0.3 < unknown / known_smallest < 3


@pytest.mark.parametrize("password", ["", "eleven char", "x" * (MAX_LENGTH + 1)])
def test_too_short_and_too_long_passwords_are_refused(password: str) -> None:
    with pytest.raises(Problem) as refused:
        hash_password(password)
    assert refused.value.code == "weak_password"
    assert not password or password not in refused.value.detail


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture(params=("memory", "database"))
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[FailureStore]:
    """Failures of one web server, and of several."""
    if request.param == "memory":
        yield FailuresInMemory()
        return
    write_database(tmp_path / "sagittal.db")
    with closing(Database(tmp_path / "sagittal.db")) as db:
        yield SharedFailures(db)


def test_what_is_counted_together_is_found_by_an_index(tmp_path: Path) -> None:
    """The rate limit uses an index, since all web servers wait for it."""
    write_database(tmp_path / "sagittal.db")
    plans: list[str] = []
    with closing(Database(tmp_path / "sagittal.db")) as db:
        throttle = Throttle(Clock(), SharedFailures(db))

        def explain(c: Connection, cursor: object, statement: str, values: Any, *_: object) -> None:
            if "failed_attempt" in statement and not statement.startswith(("EXPLAIN", "INSERT")):
                plan = c.connection.cursor().execute(f"EXPLAIN QUERY PLAN {statement}", values)
                plans.extend(step[3] for step in plan)

        event.listen(Engine, "before_cursor_execute", explain)
        try:
            position = throttle.begin("anna", "10.0.0.1")
            throttle.withdraw("anna", "10.0.0.1", position)
            throttle.succeed("anna", "10.0.0.1")
            throttle.forgive("anna")
        finally:
            event.remove(Engine, "before_cursor_execute", explain)
    assert len(plans) > 10
    assert not [step for step in plans if step.startswith("SCAN")]


def test_a_person_is_stopped_after_ten_failures_and_may_try_again_later(store: FailureStore) -> None:
    clock = Clock()
    throttle = Throttle(clock, store)
    for _ in range(MAX_PER_PAIR):
        throttle.check("anna", "10.0.0.1")
        throttle.fail("anna", "10.0.0.1")
    with pytest.raises(Problem) as refused:
        throttle.check("anna", "10.0.0.1")
    assert refused.value.status == 429
    assert refused.value.headers is not None
    assert 0 < int(refused.value.headers["Retry-After"]) <= WINDOW_S + 1
    throttle.check("anna", "10.0.0.2")
    throttle.check("berta", "10.0.0.1")
    clock.now = WINDOW_S + 1
    throttle.check("anna", "10.0.0.1")


def test_a_new_password_from_an_administrator_opens_an_account_at_once(store: FailureStore) -> None:
    throttle = Throttle(Clock(), store)
    for i in range(MAX_PER_ACCOUNT):
        throttle.fail("anna", f"10.0.0.{i % 3}")
    throttle.fail("berta", "10.0.0.9")
    throttle.forgive("anna")
    for i in range(3):
        throttle.check("anna", f"10.0.0.{i + 3}")


def test_an_account_is_closed_after_failures_from_many_addresses(store: FailureStore) -> None:
    throttle = Throttle(Clock(), store)
    for i in range(MAX_PER_ACCOUNT):
        throttle.check("anna", f"10.0.0.{i}")
        throttle.fail("anna", f"10.0.0.{i}")
    with pytest.raises(Problem):
        throttle.check("anna", "10.0.0.99")
    throttle.check("berta", "10.0.0.99")


def test_an_address_is_closed_after_failures_on_many_accounts(store: FailureStore) -> None:
    throttle = Throttle(Clock(), store)
    for i in range(MAX_PER_ADDRESS):
        throttle.check(f"user{i}", "10.0.0.1")
        throttle.fail(f"user{i}", "10.0.0.1")
    with pytest.raises(Problem):
        throttle.check("somebody", "10.0.0.1")
    throttle.check("somebody", "10.0.0.2")


def test_success_forgets_a_few_mistypes(store: FailureStore) -> None:
    throttle = Throttle(Clock(), store)
    for _ in range(MAX_PER_PAIR - 1):
        throttle.fail("anna", "10.0.0.1")
    throttle.succeed("anna", "10.0.0.1")
    throttle.fail("anna", "10.0.0.1")
    throttle.check("anna", "10.0.0.1")


def test_what_was_counted_beforehand_can_be_taken_back_and_old_failures_go(store: FailureStore) -> None:
    clock = Clock()
    throttle = Throttle(clock, store)
    for _ in range(2 * MAX_PER_PAIR):
        throttle.withdraw("anna", "10.0.0.1", throttle.begin("anna", "10.0.0.1"))
    for _ in range(MAX_PER_PAIR):
        throttle.begin("anna", "10.0.0.1")
    with pytest.raises(Problem):
        throttle.begin("anna", "10.0.0.1")
    clock.now = WINDOW_S + 1
    throttle.begin("anna", "10.0.0.1")
    assert store.work(lambda times: len(times.list_times(("anna", "10.0.0.1")))) in (1, MAX_PER_PAIR + 1)


@pytest.mark.slow
def test_a_burst_of_sign_ins_neither_takes_the_memory_nor_waits_for_ever(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(passwords, "PATIENCE_S", 0.05)
    stored = hash_password(PASSWORD)
    with passwords._slot(), passwords._slot(), pytest.raises(Problem) as refused:
        verify_password(PASSWORD, stored)
    assert (refused.value.status, refused.value.code) == (503, "busy")
    assert verify_password(PASSWORD, stored)
