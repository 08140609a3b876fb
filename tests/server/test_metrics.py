"""Prometheus metrics: request counts and state of the installation."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families
from sqlalchemy import update

from sagittal.server.clinic import patients, sessions
from sagittal.server.jobs.table import TableQueue
from sagittal.server.live_takes import live
from sagittal.server.metrics import BUCKETS_S, RequestMetrics, StateCollector
from sagittal.server.nodes.registry import Nodes
from sagittal.server.safekeeping import backup_schedule
from sagittal.server.safekeeping.backup_schedule import BackupState, Outcome
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import job, now
from tests.helpers.databases import write_database

Labels = frozenset[tuple[str, str]]


def read(metrics: RequestMetrics) -> dict[tuple[str, Labels], float]:
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(metrics.render().decode())
        for sample in family.samples
    }


def labels(**given: str) -> Labels:
    return frozenset(given.items())


def test_requests_are_counted_by_method_route_and_status_and_timed_by_route() -> None:
    metrics = RequestMetrics()
    metrics.observe("GET", "/patients/{patient_id}", 200, 0.3)
    metrics.observe("GET", "/patients/{patient_id}", 200, 0.31)
    metrics.observe("POST", "/patients/{patient_id}", 422, 0.01)
    content = read(metrics)
    route = {"route": "/patients/{patient_id}"}
    assert content["sagittal_requests_total", labels(method="GET", status="200", **route)] == 2
    assert content["sagittal_requests_total", labels(method="POST", status="422", **route)] == 1
    assert content["sagittal_request_seconds_count", labels(**route)] == 3
    assert content["sagittal_request_seconds_sum", labels(**route)] == pytest.approx(0.62)
    assert 0.3 in BUCKETS_S
    assert content["sagittal_request_seconds_bucket", labels(le="0.3", **route)] == 2


def test_methods_that_nobody_serves_are_one() -> None:
    metrics = RequestMetrics()
    for method in ("MADEUP", "INVENTED", "get"):
        metrics.observe(method, "none", 405, 0.0)
    content = read(metrics)
    assert content["sagittal_requests_total", labels(method="other", route="none", status="405")] == 3
    assert {dict(source)["method"] for name, source in content if name == "sagittal_requests_total"} == {
        "other"
    }


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data_dir=tmp_path)


@pytest.fixture
def db(settings: Settings) -> Iterator[Database]:
    write_database(settings.database)
    with closing(Database(settings.database)) as opened:
        yield opened


def ask(settings: Settings, db: Database) -> dict[tuple[str, Labels], float]:
    """Metrics of an installation whose store is unavailable."""
    metrics = RequestMetrics()
    nodes = Nodes(settings, db, lambda: None)
    checks = {"database": "ok", "store": "It cannot be reached."}
    metrics.registry.register(StateCollector(settings, db, lambda: checks, nodes))
    return read(metrics)


def test_an_empty_clinic_has_figures_of_everything_but_backups(settings: Settings, db: Database) -> None:
    answer = ask(settings, db)
    assert {source for name, source in answer if name == "sagittal_jobs"} == {
        labels(state=s) for s in ("queued", "running", "done", "failed", "cancelled")
    }
    for name in ("oldest_job_wait_seconds", "live_takes_open", "sessions", "audit_rows"):
        assert answer[f"sagittal_{name}", labels()] == 0, name
    assert answer["sagittal_disk_free_bytes", labels()] > 0
    assert answer["sagittal_part_up", labels(part="database")] == 1
    assert answer["sagittal_part_up", labels(part="store")] == 0
    assert not any("backup" in name or "restore" in name or "node" in name for name, _ in answer)


def test_visits_open_takes_and_waiting_jobs_are_counted(settings: Settings, db: Database) -> None:
    with db.write() as c:
        patient = patients.create(c, None, code="P-1").id
        session = sessions.create(c, None, patient).id
        take, _ = live.open_take(c, None, session)
        queue = TableQueue(db, 30.0)
        for key in ("a", "b"):
            queue.submit(c, key=key, kind="tiny", params={}, recording_id=None)
        c.execute(update(job).where(job.c.key == "a").values(created_at=now() - dt.timedelta(hours=1)))
    answer = ask(settings, db)
    assert answer["sagittal_sessions", labels()] == 1
    assert answer["sagittal_live_takes_open", labels()] == 1
    assert answer["sagittal_jobs", labels(state="queued")] == 2
    assert answer["sagittal_oldest_job_wait_seconds", labels()] >= 3600
    with db.write() as c:
        live.end(c, None, take.id, "finished", count=0)
        c.execute(update(job).values(state="cancelled", finished_at=now()))
    answer = ask(settings, db)
    assert answer["sagittal_live_takes_open", labels()] == 0
    assert answer["sagittal_oldest_job_wait_seconds", labels()] == 0
    assert answer["sagittal_jobs", labels(state="cancelled")] == 2


def test_backups_and_their_trial_are_told_when_there_was_one(settings: Settings, db: Database) -> None:
    timestamp = dt.datetime(2026, 3, 14, tzinfo=dt.UTC)
    good = Outcome(timestamp, True, "x.tar", "", 5000)
    tried = Outcome(timestamp + dt.timedelta(hours=1), None, "x.tar", "No room.", 0)
    backup_schedule._write(settings, BackupState(good, good, tried))
    answer = ask(settings, db)
    assert answer["sagittal_backup_last_success_timestamp_seconds", labels()] == timestamp.timestamp()
    assert answer["sagittal_backup_last_size_bytes", labels()] == 5000
    assert answer["sagittal_restore_test_timestamp_seconds", labels()] == timestamp.timestamp() + 3600
    assert answer["sagittal_restore_test_good", labels()] == 0
