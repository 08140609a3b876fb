"""Counts failed sign-ins per account and per address, so that guessing a password takes years."""

from __future__ import annotations

import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable

from server.http.problems import Problem

WINDOW_S = 15 * 60.0
MAX_PER_PAIR = 10
"""Failures on one account from one address."""
MAX_PER_ACCOUNT = 50
"""From all addresses; higher, so that a stranger cannot lock a colleague out with ten wrong guesses."""
MAX_PER_ADDRESS = 30
"""On all accounts; a clinic may share one address. NIST SP 800-63B §5.2.2 allows 100 failures in a row."""
_MAX_KEYS = 10_000


Key = tuple[str | None, str | None]


class Throttle:
    """Sliding window over failures; in memory, because one process serves the web."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._failures: defaultdict[Key, deque[float]] = defaultdict(deque)

    def begin(self, account: str, address: str) -> float:
        """Check, and count this attempt as a failure before the password is looked at; returns its time.

        A burst of guesses cannot all pass before the first of them has failed.
        """
        with self._lock:
            self._require(account, address)
            return self._count(account, address)

    def withdraw(self, account: str, address: str, at: float) -> None:
        """Take back an attempt that `begin` counted: it was right, or nobody could look at it."""
        with self._lock:
            for key in _keys(account, address):
                times = self._failures.get(key)
                if times is not None and at in times:
                    times.remove(at)
                    if not times:
                        del self._failures[key]

    def check(self, account: str, address: str) -> None:
        """Raise Problem 429 with Retry-After while one of the two has failed too often."""
        with self._lock:
            self._require(account, address)

    def _require(self, account: str, address: str) -> None:
        now = self._clock()
        wait = max(self._wait(key, limit, now) for key, limit in _keys(account, address).items())
        if wait > 0:
            seconds = int(wait) + 1
            minutes = -(-seconds // 60)
            raise Problem(
                429,
                "too_many_attempts",
                f"Too many failed attempts. Wait {minutes} min and try again, or ask an administrator.",
                headers={"Retry-After": str(seconds)},
            )

    def fail(self, account: str, address: str) -> None:
        """Count one failure of this account from this address."""
        with self._lock:
            self._count(account, address)

    def _count(self, account: str, address: str) -> float:
        now = self._clock()
        if len(self._failures) > _MAX_KEYS:
            self._forget(now)
        for key in _keys(account, address):
            self._failures[key].append(now)
        return now

    def succeed(self, account: str, address: str) -> None:
        """Forget the failures of somebody who mistyped a few times and has now signed in."""
        with self._lock:
            self._failures.pop((account, address), None)

    def forgive(self, account: str) -> None:
        """Forget all failures of an account: an administrator has given it a new password."""
        with self._lock:
            for key in [k for k in self._failures if k[0] == account]:
                del self._failures[key]

    def _wait(self, key: Key, limit: int, now: float) -> float:
        failures = self._failures.get(key)
        if failures is None:
            return 0.0
        while failures and failures[0] <= now - WINDOW_S:
            failures.popleft()
        if not failures:
            del self._failures[key]
            return 0.0
        return failures[-limit] + WINDOW_S - now if len(failures) >= limit else 0.0

    def _forget(self, now: float) -> None:
        for key in [k for k, times in self._failures.items() if times[-1] <= now - WINDOW_S]:
            del self._failures[key]


def _keys(account: str, address: str) -> dict[Key, int]:
    return {
        (account, address): MAX_PER_PAIR,
        (account, None): MAX_PER_ACCOUNT,
        (None, address): MAX_PER_ADDRESS,
    }
