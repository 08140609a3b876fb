"""A clinic on a temporary folder, for real worker processes and the tiny kind of job."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from sqlalchemy import select

from sagittal.server.clinic import patients, sessions
from sagittal.server.jobs.opening import open_queue
from sagittal.server.jobs.queue import JobView
from sagittal.server.results import analyses
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_opening import open_blobs
from sagittal.server.storage.high_water import set_mark
from sagittal.server.storage.schema.tables import job
from sagittal.server.uploads import receiving, recordings
from tests.helpers.databases import write_database
from tests.helpers.engines import choose_url
from tests.helpers.postgres import make_lasting_database

PATIENCE_S = 60.0
"""Longest wait for what must happen: far beyond what it takes, so that a loaded machine is no failure."""


T = TypeVar("T")


def until(look: Callable[[], T | None], patience_s: float = PATIENCE_S) -> T:
    limit = time.monotonic() + patience_s
    while time.monotonic() < limit:
        result = look()
        if result:
            return result
        time.sleep(0.02)
    raise AssertionError(f"waited {patience_s:g} s in vain for {look}")


def state_of(pid: int) -> str:
    """Process state letter from the kernel: T = stopped, Z and X = dead, also for missing processes."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return "X"


def alive(pid: int) -> bool:
    return state_of(pid) not in {"Z", "X"}


def find_room(clinic: Clinic, name: str) -> Settings:
    """Settings for a restore: an empty folder next to the clinic's, on PostgreSQL also an empty database."""
    url = make_lasting_database(migrated=False) if clinic.settings.database_url else ""
    return replace(clinic.settings, data_dir=clinic.folder.parent / name, database_url=url)


class Clinic:
    """One data folder with a patient, a session and a recording."""

    def __init__(
        self, folder: Path, lease_s: float, database_url: str | None = None, bucket: str = ""
    ) -> None:
        database_url = choose_url(folder) if database_url is None else database_url
        self.settings = Settings(
            data_dir=folder,
            workers=1,
            lease_s=lease_s,
            min_free_bytes=0,
            child_memory_bytes=4_000_000_000,
            task_modules=("tests.faults.tiny_tasks",),
            database_url=database_url,
            bucket=bucket,
        )
        if not database_url:
            write_database(self.settings.database)
        self.db = Database(self.settings.database_source)
        self.blobs: Any = open_blobs(self.settings)
        self.queue = open_queue(self.db, lease_s)
        self.folder = folder
        with self.db.write() as c:
            self.patient = patients.create(c, None, code="P-1")
            self.session = sessions.create(c, None, self.patient.id)
        with receiving.receive(self.db, self.blobs, self.settings, None, self.session.id, "a.txt") as upload:
            upload.write(b"signals")
            upload.keep()
        if isinstance(self.db.source, str):
            set_mark(self.db, self.settings.mark)  # as a server leaves it: workers look for it
        self._number = itertools.count()

    def submit(self, **params: Any) -> JobView:
        number = next(self._number)
        with self.db.write() as c:
            this = recordings.require_current(c, self.session.id)
            fixed = {**recordings.job_inputs(this), "manifest": None, "config": {}, **params}
            return self.queue.submit(c, key=f"tiny:{number}", kind="tiny", params=fixed, recording_id=this.id)

    def hold(self, stage: str) -> tuple[JobView, Path, Path]:
        """Submit a job that waits at a stage; return the files that signal its arrival and release it."""
        reached = self.folder / f"reached-{stage}"
        gate = self.folder / f"gate-{stage}"
        return self.submit(hold_at=stage, reached=str(reached), gate=str(gate)), reached, gate

    def ended(self, view: JobView, patience_s: float = PATIENCE_S) -> JobView:
        def look() -> JobView | None:
            response = self.queue.get(view.id)
            return response if response is not None and response.finished else None

        return until(look, patience_s)

    def row(self, view: JobView) -> Any:
        with self.db.read() as c:
            return c.execute(select(job).where(job.c.id == view.id)).one()

    def results(self) -> list[analyses.AnalysisRecord]:
        with self.db.read() as c:
            return analyses.of_session(c, self.session.id)
