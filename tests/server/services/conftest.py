"""A database of its own for a test of services."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.storage.db import Database
from tests.databases import write_database


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Database]:
    write_database(tmp_path / "sagittal.db")
    opened = Database(tmp_path / "sagittal.db")
    yield opened
    opened.close()
