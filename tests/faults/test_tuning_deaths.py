"""A tuning survives its worker: it resumes from a checkpoint with identical results."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

from sagittal.core.formats.source import SourceFile
from sagittal.server.clinic import sessions
from sagittal.server.jobs.queue import JobView
from sagittal.server.processes.supervisor import Workers
from sagittal.server.results import tunings
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import erasure
from sagittal.server.storage.references import list_referenced
from sagittal.server.storage.schema.tables import job
from sagittal.server.uploads import receiving
from tests.core.fusion.algorithms.motion import trial_bytes
from tests.faults.clinic import Clinic, until
from tests.helpers.engines import on_both_engines
from tests.helpers.kept import keep

ORDER = tunings.TuningOrder("mahony_2008", ("judge",), particles=10, iterations=70, rounds=2, random_rounds=1)
"""Some seven seconds of work: longer than a worker takes to be killed, replaced and heard of."""
TRIALS = {"fit": 60.0, "judge": 30.0}
"""Name of a trial → how long it is, s."""


@pytest.fixture
def tuning_clinic(tmp_path: Path) -> Iterator[Clinic]:
    new_clinic = Clinic(tmp_path, lease_s=1.5)
    new_clinic.settings = dataclasses.replace(
        new_clinic.settings,
        task_modules=("sagittal.server.worker.tasks", "tests.faults.tiny_tasks"),
        job_timeout_s=60.0,
    )
    for name, seconds in TRIALS.items():
        with receiving.receive(
            new_clinic.db, new_clinic.blobs, new_clinic.settings, None, new_clinic.session.id, f"{name}.npz"
        ) as upload:
            upload.write(trial_bytes(seconds))
            upload.keep()
    yield new_clinic
    new_clinic.db.close()


@pytest.fixture
def tuning_workers(tuning_clinic: Clinic) -> Iterator[Workers]:
    started = Workers(tuning_clinic.settings)
    started.start()
    yield started
    started.stop()


def submit(clinic: Clinic, **changes: Any) -> JobView:
    with clinic.db.write() as c:
        order = dataclasses.replace(ORDER, **changes)
        return tunings.submit(c, clinic.queue, None, clinic.session.id, order)


def result(clinic: Clinic) -> dict[str, Any]:
    with clinic.db.read() as c:
        [results] = tunings.of_session(c, clinic.session.id)
    return dict(results.result)


@keep
def undisturbed() -> dict[str, Any]:
    """Result of the same order without interruption."""
    files = [SourceFile.of_bytes(f"{name}.npz", trial_bytes(seconds)) for name, seconds in TRIALS.items()]
    result = tunings.prepare(files, ORDER).run(lambda *_: None).to_json()
    return dict(json.loads(json.dumps(result)))


def kept(clinic: Clinic, view: JobView) -> str | None:
    sha256: str | None = clinic.row(view).checkpoint
    return sha256


@on_both_engines
def test_a_killed_worker_costs_a_tuning_seconds_and_not_its_bits(
    tuning_clinic: Clinic, tuning_workers: Workers
) -> None:
    view = submit(tuning_clinic)
    first = until(lambda: kept(tuning_clinic, view), 300.0)
    [worker] = tuning_workers.pids
    os.kill(worker, signal.SIGKILL)
    step = json.loads(tuning_clinic.blobs.read(tuning_clinic.patient.id, first))["swarm"]["step"]
    assert step > 0
    second = until(lambda: found if (found := kept(tuning_clinic, view)) != first else None)
    assert tuning_clinic.row(view).attempt == 2
    assert until(lambda: tuning_clinic.row(view).message).startswith("Round ")
    held = json.loads(tuning_clinic.blobs.read(tuning_clinic.patient.id, second))["swarm"]["step"]
    assert held > step
    assert not tuning_clinic.blobs.path(tuning_clinic.patient.id, first).exists()
    assert tuning_clinic.ended(view, 300.0).state == "done"
    assert kept(tuning_clinic, view) is None
    assert result(tuning_clinic) == undisturbed()


def test_a_tuning_makes_way_for_what_is_urgent_and_goes_on(
    tuning_clinic: Clinic, tuning_workers: Workers
) -> None:
    view = submit(tuning_clinic, seed=1)
    until(lambda: kept(tuning_clinic, view), 300.0)
    urgent = tuning_clinic.submit()
    assert tuning_clinic.ended(urgent).state == "done"
    assert not tuning_clinic.row(view).finished_at
    until(lambda: tuning_clinic.row(view).state == "running" and tuning_clinic.row(view).attempt == 2)
    assert tuning_clinic.row(view).deaths == 0
    with tuning_clinic.db.write() as c:
        tuning_clinic.queue.cancel(c, view.id)
    assert tuning_clinic.ended(view, 5.0).state == "cancelled"


@on_both_engines
def test_erasing_a_session_takes_the_checkpoint_along(tuning_clinic: Clinic, tuning_workers: Workers) -> None:
    view = submit(tuning_clinic, seed=2)
    until(lambda: kept(tuning_clinic, view), 300.0)
    reviewed = ReviewedAnalyses(tuning_clinic.blobs)
    erasure.erase_session(tuning_clinic.db, reviewed, tuning_clinic.settings, None, tuning_clinic.session.id)
    space = tuning_clinic.blobs.root / tuning_clinic.patient.id

    def empty() -> bool:
        return not space.exists() or not list(space.iterdir())

    until(empty)
    with tuning_clinic.db.read() as c:
        assert list_referenced(c) == set()
        assert c.execute(select(job)).all() == []
        assert sessions.of_patient(c, tuning_clinic.patient.id) == []
