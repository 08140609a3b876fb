"""Several workers on one queue, killed at random: every job ends once, on both engines."""

from __future__ import annotations

import os
import random
import signal
import time
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import func, select

from sagittal.server.processes.supervisor import Workers
from sagittal.server.storage.db import Source
from sagittal.server.storage.schema.tables import analysis, job
from tests.faults.clinic import PATIENCE_S, Clinic

WORKERS, JOBS, KILLS = 4, 60, 5


def test_every_job_ends_once_on_four_workers_that_are_killed_at_random(
    tmp_path: Path, source: Source, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONWARNINGS", "error")
    clinic = Clinic(tmp_path, lease_s=1.5, database_url=source if isinstance(source, str) else "")
    with closing(clinic.db):
        views = [clinic.submit() for _ in range(JOBS)]
        workers = Workers(replace(clinic.settings, workers=WORKERS))
        workers.start()
        try:
            killed = kill_some(clinic, workers, random.Random(1))  # noqa: S311 - repeatable
            ended = [clinic.ended(view) for view in views]
        finally:
            workers.stop()
        assert killed == KILLS
        assert Counter(view.state for view in ended) == {"done": JOBS}
        with clinic.db.read() as c:
            results = c.execute(select(analysis.c.job_id)).scalars().all()
            deaths = c.execute(select(func.sum(job.c.deaths))).scalar_one()
        assert sorted(results) == sorted(view.id for view in views)
        assert 1 <= deaths <= KILLS  # a worker may die between two jobs


def kill_some(clinic: Clinic, workers: Workers, chance: random.Random) -> int:
    """Kill workers while they have a job that no other one has died on; how many."""
    killed, limit = 0, time.monotonic() + PATIENCE_S
    running = select(job.c.worker).where(job.c.state == "running", job.c.deaths == 0)
    while killed < KILLS and time.monotonic() < limit:
        with clinic.db.read() as c:
            busy = {int(name.split(":")[1]) for name in c.execute(running).scalars()}
        living = sorted(busy.intersection(workers.pids))
        if living:
            os.kill(chance.choice(living), signal.SIGKILL)
            killed += 1
        time.sleep(0.05)
    return killed
