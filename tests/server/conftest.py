"""Settings of the server's tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi import FastAPI

from sagittal.server.auth import passwords
from sagittal.server.jobs.opening import open_queue
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_opening import open_blobs
from tests.helpers.clinic import CHEAP, Clinic
from tests.helpers.databases import write_database
from tests.helpers.engines import bare_source, choose_url, engine, postgres, source  # noqa: F401 - fixtures

NOBODY = CHEAP.hash("no account has this password")


@pytest.fixture(autouse=True)
def cheap_passwords(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sign in without the tenths of a second that a real hash takes; their own tests have the real one."""
    if request.path.name != "test_passwords.py":
        monkeypatch.setattr(passwords, "_HASHER", CHEAP)
        monkeypatch.setattr(passwords, "_nobody", lambda: NOBODY)


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Database]:
    settings = Settings(data_dir=tmp_path, database_url=choose_url(tmp_path))
    if not settings.database_url:
        write_database(settings.database)
    opened = Database(settings.database_source)
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory, engine: str) -> Iterator[Clinic]:  # noqa: F811
    """Database, files, queue and analyses of one clinic without a server."""
    folder = tmp_path_factory.mktemp("stored")
    settings = Settings(data_dir=folder, database_url=choose_url(folder))
    if not settings.database_url:
        write_database(settings.database)
    app = FastAPI()
    app.state.db = Database(settings.database_source)
    app.state.blobs = open_blobs(settings)
    app.state.queue = open_queue(app.state.db, settings.lease_s)
    app.state.reviewed = ReviewedAnalyses(app.state.blobs)
    yield Clinic(app, settings)
    app.state.db.close()
