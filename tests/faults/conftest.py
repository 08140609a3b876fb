"""A clinic and its workers."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from sagittal.server.processes.supervisor import Workers
from tests.faults.clinic import Clinic, alive
from tests.faults.forking import Forker
from tests.helpers.engines import engine, postgres, source  # noqa: F401 - fixtures


@pytest.fixture
def clinic(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Clinic]:
    """A lease of 1.5 s, so that deaths are seen soon; a test may ask for another."""
    new_clinic = Clinic(tmp_path, lease_s=getattr(request, "param", 1.5))
    yield new_clinic
    new_clinic.db.close()


@pytest.fixture
def workers(clinic: Clinic, monkeypatch: pytest.MonkeyPatch) -> Iterator[Workers]:
    monkeypatch.setenv("PYTHONWARNINGS", "error")
    started = Workers(clinic.settings)
    started.start()
    yield started
    pids = started.pids
    started.stop()
    assert not any(alive(pid) for pid in pids)


@pytest.fixture(scope="module")
def forker() -> Iterator[Forker]:
    """Where servers come from that are started again and again."""
    started = Forker()
    yield started
    started.end()


@pytest.fixture(scope="session", autouse=True)
def _small_arenas() -> None:
    # a test that allocates until refused must not take the machine with it
    os.environ.setdefault("MALLOC_ARENA_MAX", "2")
