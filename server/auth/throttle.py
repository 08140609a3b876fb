"""Limits failed sign-ins per account and per address, so that guessing a password takes years.

A single web server counts in memory; several share their counts in the database.
"""

from __future__ import annotations

import datetime as dt
import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from sqlalchemy import ColumnElement, Connection, and_, delete, insert, select
from sqlalchemy.exc import OperationalError

from sagittal.core.message import Message
from sagittal.server.http.problems import Problem
from sagittal.server.storage.db import Database
from sagittal.server.storage.refusal import refusal_of
from sagittal.server.storage.schema.node_tables import failed_attempt
from sagittal.server.storage.schema.tables import new_id

WINDOW_S = 15 * 60.0
MAX_PER_PAIR = 10
"""Failures on one account from one address."""
MAX_PER_ACCOUNT = 50
"""From all addresses; higher, so that a stranger cannot lock out a user with ten wrong guesses."""
MAX_PER_ADDRESS = 30
"""On all accounts; a clinic may share one address. NIST SP 800-63B §5.2.2 allows 100 consecutive failures."""
_MAX_KEYS = 10_000


Key = tuple[str | None, str | None]
Found = TypeVar("Found")


class FailureTimes(Protocol):
    """Times of failures by key."""

    def list_times(self, key: Key) -> Sequence[float]:
        """Times of a key, oldest first."""

    def add(self, key: Key, time: float) -> None:
        """Add a failure."""

    def remove(self, key: Key, time: float) -> None:
        """Remove a recorded failure; no error if absent."""

    def clear(self, key: Key) -> None:
        """Remove all failures of a key."""

    def clear_account(self, account: str) -> None:
        """Remove all failures of an account, from any address."""

    def forget(self, cutoff: float) -> None:
        """Remove expired failures, now or later."""


class FailureStore(Protocol):
    """Storage of failures."""

    def work(self, do: Callable[[FailureTimes], Found]) -> Found:
        """Call `do` with exclusive access to the failures and return its result."""

    def look(self, do: Callable[[FailureTimes], Found]) -> Found:
        """Call `do` for read-only access and return its result."""


class Throttle:
    """Sliding window over failures.

    Parameters
    ----------
    clock : seconds; common to all web servers that share counts.
    """

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, store: FailureStore | None = None
    ) -> None:
        self._clock = clock
        self._store: FailureStore = FailuresInMemory() if store is None else store

    def begin(self, account: str, address: str) -> float:
        """Check the limit, count this attempt as a failure before verification, and return its time.

        Counting first keeps a burst of guesses from passing before the first of them has failed.
        """

        # blocked attempts do not use up further attempts of others
        self.check(account, address)

        def do(times: FailureTimes) -> float:
            self._require(times, account, address)
            return self._count(times, account, address)

        return self._store.work(do)

    def withdraw(self, account: str, address: str, time: float) -> None:
        """Remove an attempt counted by `begin`: it succeeded, or could not be verified."""

        def do(times: FailureTimes) -> None:
            for key in _keys(account, address):
                times.remove(key, time)

        self._store.work(do)

    def check(self, account: str, address: str) -> None:
        """Raise Problem 429 with Retry-After while the account or the address has failed too often."""
        self._store.look(lambda times: self._require(times, account, address))

    def fail(self, account: str, address: str) -> None:
        """Count one failure of this account from this address."""
        self._store.work(lambda times: self._count(times, account, address))

    def succeed(self, account: str, address: str) -> None:
        """Clear the failures of this account from this address after a successful sign-in."""
        self._store.work(lambda times: times.clear((account, address)))

    def forgive(self, account: str) -> None:
        """Clear all failures of an account, after an administrator has set a new password."""
        self._store.work(lambda times: times.clear_account(account))

    def _require(self, times: FailureTimes, account: str, address: str) -> None:
        now = self._clock()
        wait = max(_wait(times.list_times(key), limit, now) for key, limit in _keys(account, address).items())
        if wait > 0:
            seconds = int(wait) + 1
            minutes = -(-seconds // 60)
            raise Problem(
                429,
                "too_many_attempts",
                Message(
                    "Too many failed attempts. Wait {minutes} min and try again, or ask an administrator.",
                    minutes=minutes,
                ),
                headers={"Retry-After": str(seconds)},
            )

    def _count(self, times: FailureTimes, account: str, address: str) -> float:
        now = self._clock()
        times.forget(now - WINDOW_S)
        for key in _keys(account, address):
            times.add(key, now)
        return now


class FailuresInMemory:
    """Failures of one process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._failures: defaultdict[Key, deque[float]] = defaultdict(deque)

    def work(self, do: Callable[[FailureTimes], Found]) -> Found:
        """See FailureStore."""
        with self._lock:
            return do(self)

    look = work

    def list_times(self, key: Key) -> Sequence[float]:
        """See FailureTimes."""
        return self._failures.get(key, ())

    def add(self, key: Key, time: float) -> None:
        """See FailureTimes."""
        self._failures[key].append(time)

    def remove(self, key: Key, time: float) -> None:
        """See FailureTimes."""
        times = self._failures.get(key)
        if times is not None and time in times:
            times.remove(time)
            if not times:
                del self._failures[key]

    def clear(self, key: Key) -> None:
        """See FailureTimes."""
        self._failures.pop(key, None)

    def clear_account(self, account: str) -> None:
        """See FailureTimes."""
        for key in [k for k in self._failures if k[0] == account]:
            del self._failures[key]

    def forget(self, cutoff: float) -> None:
        """See FailureTimes; runs only when there are many entries."""
        if len(self._failures) > _MAX_KEYS:
            for key in [k for k, times in self._failures.items() if times[-1] <= cutoff]:
                del self._failures[key]


class SharedFailures:
    """Failures of all web servers, in the database; in memory while its disk is not writable."""

    def __init__(self, db: Database) -> None:
        self._db, self._memory = db, FailuresInMemory()

    def work(self, do: Callable[[FailureTimes], Found]) -> Found:
        """See FailureStore."""
        try:
            with self._db.write() as c:
                return do(_FailureRows(c))
        except OperationalError as error:
            if refusal_of(error) is None:
                raise
            return self._memory.work(do)

    def look(self, do: Callable[[FailureTimes], Found]) -> Found:
        """See FailureStore; includes failures not yet written."""
        self._memory.work(do)
        with self._db.read() as c:
            return do(_FailureRows(c))


class _FailureRows:
    """Failures within one transaction."""

    def __init__(self, c: Connection) -> None:
        self._c = c

    def list_times(self, key: Key) -> Sequence[float]:
        query = select(failed_attempt.c.at).where(_is(key)).order_by(failed_attempt.c.at)
        return [time.timestamp() for time in self._c.execute(query).scalars()]

    def add(self, key: Key, time: float) -> None:
        account, address = key
        row = {"id": new_id(), "account": account, "address": address, "at": _moment(time)}
        self._c.execute(insert(failed_attempt).values(row))

    def remove(self, key: Key, time: float) -> None:
        query = select(failed_attempt.c.id).where(_is(key), failed_attempt.c.at == _moment(time)).limit(1)
        self._c.execute(delete(failed_attempt).where(failed_attempt.c.id.in_(query.scalar_subquery())))

    def clear(self, key: Key) -> None:
        self._c.execute(delete(failed_attempt).where(_is(key)))

    def clear_account(self, account: str) -> None:
        self._c.execute(delete(failed_attempt).where(failed_attempt.c.account == account))

    def forget(self, cutoff: float) -> None:
        self._c.execute(delete(failed_attempt).where(failed_attempt.c.at <= _moment(cutoff)))


def _is(key: Key) -> ColumnElement[bool]:
    account, address = key
    return and_(failed_attempt.c.account == account, failed_attempt.c.address == address)


def _moment(timestamp: float) -> dt.datetime:
    return dt.datetime.fromtimestamp(timestamp, dt.UTC)


def _wait(times: Sequence[float], limit: int, now: float) -> float:
    """Seconds until fewer than `limit` of these failures are within the window."""
    failures = [time for time in times if time > now - WINDOW_S]
    return failures[-limit] + WINDOW_S - now if len(failures) >= limit else 0.0


def _keys(account: str, address: str) -> dict[Key, int]:
    return {
        (account, address): MAX_PER_PAIR,
        (account, None): MAX_PER_ACCOUNT,
        (None, address): MAX_PER_ADDRESS,
    }
