from __future__ import annotations

import time

import pytest

from server.auth import passwords
from server.auth.passwords import MAX_LENGTH, hash_password, verify_password
from server.auth.throttle import MAX_PER_ACCOUNT, MAX_PER_ADDRESS, MAX_PER_PAIR, WINDOW_S, Throttle
from server.http.problems import Problem
from tests.server.clinic import PASSWORD


def test_a_password_is_stored_as_argon2id_and_only_it_verifies() -> None:
    stored = hash_password(PASSWORD)
    assert stored.startswith("$argon2id$v=19$m=65536,t=3,p=4$")
    assert PASSWORD not in stored
    assert verify_password(PASSWORD, stored)
    assert not verify_password(PASSWORD + "x", stored)
    assert not verify_password(PASSWORD, "not a hash")


def test_an_unknown_account_takes_as_long_as_a_wrong_password() -> None:
    def seconds(stored: str | None) -> float:
        start = time.perf_counter()
        assert not verify_password("wrong password", stored)
        return time.perf_counter() - start

    stored = hash_password(PASSWORD)
    known = min(seconds(stored) for _ in range(3))
    unknown = min(seconds(None) for _ in range(3))
    # without the dummy hash the ratio is below 0.001
    assert 0.3 < unknown / known < 3


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


def test_a_person_is_stopped_after_ten_failures_and_may_try_again_later() -> None:
    clock = Clock()
    throttle = Throttle(clock)
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


def test_a_new_password_from_an_administrator_opens_an_account_at_once() -> None:
    throttle = Throttle(Clock())
    for i in range(MAX_PER_ACCOUNT):
        throttle.fail("anna", f"10.0.0.{i % 3}")
    throttle.fail("berta", "10.0.0.9")
    throttle.forgive("anna")
    for i in range(3):
        throttle.check("anna", f"10.0.0.{i + 3}")


def test_an_account_is_closed_after_failures_from_many_addresses() -> None:
    throttle = Throttle(Clock())
    for i in range(MAX_PER_ACCOUNT):
        throttle.check("anna", f"10.0.0.{i}")
        throttle.fail("anna", f"10.0.0.{i}")
    with pytest.raises(Problem):
        throttle.check("anna", "10.0.0.99")
    throttle.check("berta", "10.0.0.99")


def test_an_address_is_closed_after_failures_on_many_accounts() -> None:
    throttle = Throttle(Clock())
    for i in range(MAX_PER_ADDRESS):
        throttle.check(f"user{i}", "10.0.0.1")
        throttle.fail(f"user{i}", "10.0.0.1")
    with pytest.raises(Problem):
        throttle.check("somebody", "10.0.0.1")
    throttle.check("somebody", "10.0.0.2")


def test_success_forgets_a_few_mistypes() -> None:
    throttle = Throttle(Clock())
    for _ in range(MAX_PER_PAIR - 1):
        throttle.fail("anna", "10.0.0.1")
    throttle.succeed("anna", "10.0.0.1")
    throttle.fail("anna", "10.0.0.1")
    throttle.check("anna", "10.0.0.1")


def test_a_burst_of_sign_ins_neither_takes_the_memory_nor_waits_for_ever(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(passwords, "PATIENCE_S", 0.05)
    stored = hash_password(PASSWORD)
    with passwords._slot(), passwords._slot(), pytest.raises(Problem) as refused:
        verify_password(PASSWORD, stored)
    assert (refused.value.status, refused.value.code) == (503, "busy")
    assert verify_password(PASSWORD, stored)
