"""A clinic whose database is a file, for commands that are given its folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.faults.clinic import Clinic


@pytest.fixture
def clinic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Clinic]:
    """One patient with a stored file; no environment variable points to a clinic."""
    for name in ("SAGITTAL_DATABASE_URL", "SAGITTAL_BUCKET", "SAGITTAL_IDENTITY_KEY"):
        monkeypatch.delenv(name, raising=False)
    new_clinic = Clinic(tmp_path / "home", lease_s=5.0, database_url="")
    yield new_clinic
    new_clinic.db.close()
