"""Settings of the server's tests."""

from __future__ import annotations

import pytest
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from server.auth import passwords
from tests.engines import bare_source, engine, postgres, source  # noqa: F401 - fixtures

CHEAP = PasswordHash((Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1),))
NOBODY = CHEAP.hash("no account has this password")


@pytest.fixture(autouse=True)
def cheap_passwords(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sign in without the tenths of a second that a real hash takes; their own tests have the real one."""
    if request.path.name != "test_passwords.py":
        monkeypatch.setattr(passwords, "_HASHER", CHEAP)
        monkeypatch.setattr(passwords, "_nobody", lambda: NOBODY)
