"""A database of its own for a test of services."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.storage.db import Database
from server.storage.migrate import upgrade


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Database]:
    upgrade(tmp_path / "sagittal.db")
    opened = Database(tmp_path / "sagittal.db")
    yield opened
    opened.close()
