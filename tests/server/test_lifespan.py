"""Resources opened and closed by the web process, and its status messages."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest
from fastapi import FastAPI
from sqlalchemy import select

from sagittal.server.clinic import patients
from sagittal.server.context import State
from sagittal.server.lifespan import _say_estimators, _say_workers, run_installation
from sagittal.server.metrics import RequestMetrics
from sagittal.server.processes.supervisor import Workers
from sagittal.server.safekeeping.custody import StrangersError
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.high_water import read_mark
from sagittal.server.storage.schema.tables import patient
from tests.helpers.databases import write_database


@pytest.fixture
def app(tmp_path: Path) -> FastAPI:
    """An application without routes, on an empty clinic without estimators."""
    fast_a_p_i, settings = FastAPI(), Settings(data_dir=tmp_path, live_workers=0)
    fast_a_p_i.state = State({"settings": settings, "metrics": RequestMetrics()})
    write_database(settings.database)
    return fast_a_p_i


def settings_of(app: FastAPI) -> Settings:
    result = app.state.settings
    assert isinstance(result, Settings)
    return result


@pytest.mark.anyio
async def test_parts_are_open_while_it_runs_and_afterwards_closed_with_a_mark(app: FastAPI) -> None:
    async with run_installation(app):
        assert set(app.state.readiness.checks()) >= {"workers", "estimators", "database"}
        assert "node" not in app.state.readiness.checks()
        assert b"sagittal_sessions 0.0" in app.state.metrics.render()
        with app.state.db.write() as c:
            patients.create(c, None, code="P-1")
    assert b"sagittal_sessions" not in app.state.metrics.render()
    mark = read_mark(settings_of(app).mark)
    assert mark is not None
    assert mark.seq == 1
    with closing(Database(settings_of(app).database)) as db, db.read() as c:
        assert c.execute(select(patient.c.code)).scalars().all() == ["P-1"]


@pytest.mark.anyio
async def test_a_database_that_has_lost_rows_is_served_and_doubted_aloud(
    app: FastAPI, caplog: pytest.LogCaptureFixture
) -> None:
    settings_of(app).mark.write_text(json.dumps({"seq": 7, "hash": "a" * 64}))
    async with run_installation(app):
        assert "ends at row 0, but had reached row 7" in caplog.text
        assert "No stored file is taken away meanwhile" in caplog.text


@pytest.mark.anyio
async def test_files_of_another_clinic_keep_it_from_starting(app: FastAPI) -> None:
    FolderBlobs(settings_of(app).blobs).put("a" * 32, b"walk")
    with pytest.raises(StrangersError):
        async with run_installation(app):
            pass
    assert not hasattr(app.state, "db")


def test_workers_that_nobody_started_are_no_fault_and_those_that_died_are_counted(app: FastAPI) -> None:
    state = State({"settings": settings_of(app)})
    assert _say_workers(state) == "ok"
    state.workers = Workers(state.settings)
    expected_workers = state.settings.workers
    assert expected_workers > 0
    assert _say_workers(state) == f"0 of {expected_workers} worker processes run; see the server's log."


@pytest.mark.parametrize(
    ("living", "said"),
    [((1, 2), "ok"), ((1, 2, 3), "ok"), ((1,), "1 of 2 estimator processes run; see the server's log.")],
)
def test_estimators_that_died_are_counted(living: tuple[int, ...], said: str) -> None:
    hub = SimpleNamespace(pool=SimpleNamespace(pids=living))
    state = State({"settings": SimpleNamespace(live_workers=2), "hub": hub})
    assert _say_estimators(state) == said
