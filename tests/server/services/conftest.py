"""A database of its own for a test of services."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.settings import Settings
from server.storage.db import Database
from tests.helpers.databases import write_database
from tests.helpers.engines import choose_url


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Database]:
    settings = Settings(data_dir=tmp_path, database_url=choose_url(tmp_path))
    if not settings.database_url:
        write_database(settings.database)
    opened = Database(settings.database_source)
    yield opened
    opened.close()
