"""A database of its own for a test of services, and a clinic without a web process for a whole file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi import FastAPI

from sagittal.server.jobs.opening import open_queue
from sagittal.server.services.reviewed import ReviewedAnalyses
from sagittal.server.settings import Settings
from sagittal.server.storage.blob_opening import open_blobs
from sagittal.server.storage.db import Database
from tests.helpers.databases import write_database
from tests.helpers.engines import choose_url
from tests.server.clinic import Clinic


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Database]:
    settings = Settings(data_dir=tmp_path, database_url=choose_url(tmp_path))
    if not settings.database_url:
        write_database(settings.database)
    opened = Database(settings.database_source)
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory, engine: str) -> Iterator[Clinic]:
    """What services work on: database, files, queue and analyses of one clinic, which nobody serves."""
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
