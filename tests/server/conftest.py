"""Settings of the server's tests."""

from __future__ import annotations

import pytest

from sagittal.server.auth import passwords
from tests.helpers.engines import bare_source, engine, postgres, source  # noqa: F401 - fixtures
from tests.server.clinic import CHEAP

NOBODY = CHEAP.hash("no account has this password")


@pytest.fixture(autouse=True)
def cheap_passwords(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sign in without the tenths of a second that a real hash takes; their own tests have the real one."""
    if request.path.name != "test_passwords.py":
        monkeypatch.setattr(passwords, "_HASHER", CHEAP)
        monkeypatch.setattr(passwords, "_nobody", lambda: NOBODY)
