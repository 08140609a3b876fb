"""Many recordings queued at once: each is analysed once, workers are killed, and pages come meanwhile.

By hand: `pytest validation/bench/test_load.py --recordings 1000 -n 0`, or 40. Simulated workers run always,
and tests/faults/test_many_workers.py.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import random
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import httpx
import numpy as np
import pytest
from sqlalchemy import func, select

from sagittal.core.formats import write_recording
from sagittal.core.simulate import RecordingSetup, Stand, Straight, simulate
from sagittal.server.jobs.opening import open_queue
from sagittal.server.processes.supervisor import Workers
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database, Source
from sagittal.server.storage.schema.tables import analysis, job
from tests.helpers.service import Service, new_session, served

pytestmark = pytest.mark.timeout(3600)

WHOLE: Final = 200
"""Recordings from which on there are four workers, and more simulated ones."""
WORKERS: Final = 4
PER_KILL: Final = 40
"""Recordings for which one worker is killed."""
LEASE_S: Final = 5.0
PAUSE_S: Final = 0.1
"""Between two pages that somebody asks for."""
PAGE_S: Final = 0.3
"""A page must be there by then."""
MANY: Final = (2, 8, 32, 64)
"""Simulated workers."""
JOB_S: Final = 0.5
PER_WORKER: Final = 3
GROWS: Final = 2.0
"""Times as much four times as many do at least; without waiting for each other it would be four."""
BEHIND_S: Final = 600.0
"""Longest time without one more job that has ended."""


@pytest.fixture
def recordings(request: pytest.FixtureRequest) -> int:
    expected: int = request.config.getoption("--recordings")
    return expected


@pytest.fixture
def queued(recordings: int) -> int:
    """The same, for what queues them; before a server is started."""
    if not recordings:
        pytest.skip("half a minute of processors and more: run with --recordings 40, or 1000")
    return recordings


@pytest.fixture
def service(source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    """Server without workers, on either engine."""
    settings = settings_of(tmp_path, source)
    for name, value in settings.environment().items():
        if name != "SAGITTAL_PORT":
            monkeypatch.setenv(name, value)
    with served(settings.data_dir) as started:
        yield started


def settings_of(folder: Path, source: Source, workers: int = 0) -> Settings:
    return Settings(
        data_dir=folder,
        workers=workers,
        live_workers=0,
        lease_s=LEASE_S,
        min_free_bytes=0,
        database_url=source if isinstance(source, str) else "",
    )


def test_each_recording_is_analysed_once_and_pages_come_meanwhile(
    queued: int, service: Service, source: Source, tmp_path: Path
) -> None:
    recordings, is_whole = queued, queued >= WHOLE
    sessions, submit_s = queue_recordings(service.client, recordings)
    workers = Workers(settings_of(tmp_path, source, WORKERS if is_whole else 2))
    db = Database(source)
    visitor = Visitor(service.client, sessions)
    began = time.monotonic()
    workers.start()
    try:
        with visitor.look_around():
            killed = kill_until_all_ended(db, workers, recordings // PER_KILL)
    finally:
        workers.stop()
    took_s = time.monotonic() - began
    with contextlib.closing(db), db.read() as c:
        states = Counter(c.execute(select(job.c.state).where(job.c.kind == "analyse")).scalars())
        results = c.execute(select(analysis.c.recording_id)).scalars().all()
        deaths = c.execute(select(func.sum(job.c.deaths))).scalar_one()
    share = 99 if is_whole else 90
    worst, median = np.percentile(visitor.took, [share, 50])
    say(
        f"{'SQLite' if isinstance(source, Path) else 'PostgreSQL'}: {recordings} queued in {submit_s:.0f} s, "
        f"done in {took_s:.0f} s ({recordings / took_s:.2f}/s), {killed} kills, {deaths} on jobs; "
        f"{len(visitor.took)} pages, median {1e3 * median:.0f} ms, p{share} {1e3 * worst:.0f} ms, "
        f"longest {1e3 * max(visitor.took):.0f} ms"
    )
    say(", ".join(f"{kind} {1e3 * np.percentile(s, share):.0f}" for kind, s in visitor.by_kind.items()))
    assert states == {"done": recordings}
    assert len(results) == len(set(results)) == recordings
    assert killed >= recordings // PER_KILL
    assert worst <= PAGE_S


def test_more_workers_do_more_at_a_time(source: Source, tmp_path: Path, recordings: int) -> None:
    """Throughput of simulated workers, which sleep and write like real ones."""
    db = Database(source)
    rates = {}
    with contextlib.closing(db):
        queue = open_queue(db, LEASE_S)
        for count in MANY if recordings >= WHOLE else MANY[:2]:
            with db.write() as c:
                for number in range(PER_WORKER * count):
                    queue.submit(c, key=f"{count}:{number}", kind="simulated", params={})
            began = time.monotonic()
            with ThreadPoolExecutor(count) as pool:
                done = sum(pool.map(work_off, [source] * count))
            rates[count] = done / (time.monotonic() - began)
            assert done == PER_WORKER * count
    say(
        f"{'SQLite' if isinstance(source, Path) else 'PostgreSQL'}, simulated workers: "
        + ", ".join(f"{count} {rate:.1f}/s" for count, rate in rates.items())
    )
    few, more = MANY[:2]
    assert rates[more] >= GROWS * rates[few]


def work_off(source: Source) -> int:
    """Be a worker of jobs that take JOB_S each, until none is left; how many it did."""
    done = 0
    with contextlib.closing(Database(source)) as db:
        queue = open_queue(db, LEASE_S)
        name = f"simulated:{threading.get_ident()}"
        while (claim := queue.claim(name, ("simulated",))) is not None:
            queue.progress(claim, "computing", 0.0)
            time.sleep(JOB_S)
            queue.heartbeat(claim)
            assert queue.finish(claim, lambda c: None)
            done += 1
    return done


def queue_recordings(client: httpx.Client, count: int) -> tuple[list[str], float]:
    """Upload recordings, each to a separate visit, and request their analyses; return visits and seconds."""
    one = RecordingSetup(worn=("pelvis",))
    contents = [
        write_recording(
            simulate((Stand(3.0), Straight(8.0, 0.64, 0.54), Stand(2.0)), seed=seed, setup=one).recording
        )
        for seed in range(3)
    ]
    began = time.monotonic()
    result = []
    for number in range(count):
        session = new_session(client, f"L-{number}")
        content = contents[number % len(contents)]
        client.put(f"/api/v1/sessions/{session}/files/walk.parquet", content=content).raise_for_status()
        client.post(f"/api/v1/sessions/{session}/analyses", json={}).raise_for_status()
        result.append(session)
    return result, time.monotonic() - began


def kill_until_all_ended(db: Database, workers: Workers, kills: int) -> int:
    """Kill a worker that has a job, again and again while jobs end; how many, once all have ended."""
    chance = random.Random(1)  # noqa: S311 - repeatable
    ended = select(func.count()).where(job.c.finished_at.is_not(None))
    waiting = select(func.count()).where(job.c.finished_at.is_(None))
    running = select(job.c.worker).where(job.c.state == "running", job.c.deaths == 0)
    killed, observations, moved = 0, 0, time.monotonic()
    while True:
        with db.read() as c:
            done, left = c.execute(ended).scalar_one(), c.execute(waiting).scalar_one()
            busy = {int(name.split(":")[1]) for name in c.execute(running).scalars()}
        if not left:
            return killed
        if done > observations:
            observations, moved = done, time.monotonic()
        assert time.monotonic() < moved + BEHIND_S
        living = sorted(busy.intersection(workers.pids))
        if living and killed < kills and done >= (killed + 1) * (done + left) / (kills + 1):
            os.kill(chance.choice(living), signal.SIGKILL)
            killed += 1
        time.sleep(0.1)


@dataclass
class Visitor:
    """Somebody who looks at one page after another; how long each took, s."""

    client: httpx.Client
    sessions: Sequence[str]
    took: list[float] = field(default_factory=list)
    by_kind: dict[str, list[float]] = field(default_factory=dict)

    @contextlib.contextmanager
    def look_around(self) -> Iterator[None]:
        over = threading.Event()
        with ThreadPoolExecutor(1) as pool:
            looking = pool.submit(self._look, over)
            try:
                yield
            finally:
                over.set()
                looking.result()

    def _look(self, over: threading.Event) -> None:
        patient = self.client.get(f"/api/v1/sessions/{self.sessions[0]}").json()["patient_id"]
        pages = {
            "patients": "/patients",
            "search": "/patients?q=L-1",
            "patient": f"/patients/{patient}",
            "session": f"/sessions/{self.sessions[0]}",
            "jobs": "/jobs",
            "API": "/api/v1/patients",
        }
        for page in pages.values():  # templates are compiled once
            self.client.get(page).raise_for_status()
        for kind, page in itertools.cycle(pages.items()):
            if over.wait(PAUSE_S):
                return
            began = time.perf_counter()
            self.client.get(page).raise_for_status()
            self.took.append(time.perf_counter() - began)
            self.by_kind.setdefault(kind, []).append(self.took[-1])


def say(text: str) -> None:
    sys.stdout.write(text + "\n")
