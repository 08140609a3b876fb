"""The simulated clinic of `sagittal demo`: four patients, two visits each, uploaded like any recording.

Run as a module it fills the data folder of its environment; simulating takes seconds of computing, so this is
a process of its own.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass

from core.recording import Recording
from server.jobs.table import TableQueue
from server.services import analyses, patients, recordings, sessions
from server.settings import Settings, load_settings
from server.storage.blobs import BlobStore
from server.storage.db import Database
from server.storage.tables import now


@dataclass(frozen=True)
class Person:
    """A simulated patient."""

    code: str
    sex: str
    birth_year: int
    height_m: float
    note: str


@dataclass(frozen=True)
class Visit:
    """One visit: who, which script of core/simulate, how many days ago, seed."""

    person: Person
    title: str
    script: str
    days_ago: int
    seed: int


ADA = Person("DEMO-1", "female", 1958, 1.64, "Simulated, healthy gait at comfortable speed.")
BEN = Person("DEMO-2", "male", 1949, 1.78, "Simulated, healthy gait, slow.")
CLEO = Person("DEMO-3", "female", 1991, 1.71, "Simulated, healthy gait, fast with turns.")
DAN = Person("DEMO-4", "male", 1972, 1.83, "Simulated, one sensor lost for ten seconds and noisy sensors.")

VISITS = (
    Visit(ADA, "Walk, comfortable", "comfortable", 3, 11),
    Visit(BEN, "Walk, slow", "slow", 5, 21),
    Visit(CLEO, "Walk, fast with turns", "fast_with_turns", 2, 31),
    Visit(DAN, "Walk, one sensor lost", "lost_sensor", 8, 41),
    Visit(ADA, "Walk, slow", "slow", 38, 12),
    Visit(BEN, "Walk, slow", "slow", 47, 22),
    Visit(CLEO, "Walk, comfortable", "comfortable", 30, 32),
    Visit(DAN, "Walk, comfortable", "comfortable", 36, 42),
)


def fill(settings: Settings) -> None:
    """Add all patients and visits and ask for their analyses, the newest visit of each patient first."""
    from core.simulate import mt_files, simulate_scenario

    with closing(Database(settings.database)) as db:
        blobs = BlobStore(settings.blobs)
        known: dict[str, str] = {}
        with db.write() as c:
            for person in dict.fromkeys(v.person for v in VISITS):
                fields = {k: v for k, v in vars(person).items() if k != "code"}
                known[person.code] = patients.create(c, None, code=person.code, **fields).id
        for visit in VISITS:
            made = simulate_scenario(visit.script, visit.seed, visit.person.height_m)
            files = mt_files(made.recording, visit.script, made.first_counter)
            _add(db, blobs, settings, visit, known[visit.person.code], made.recording, files)


def _add(
    db: Database,
    blobs: BlobStore,
    settings: Settings,
    visit: Visit,
    patient_id: str,
    recording: Recording,
    files: Mapping[str, bytes],
) -> None:
    day = now().date() - dt.timedelta(days=visit.days_ago)
    with db.write() as c:
        session = sessions.create(c, None, patient_id, title=visit.title, performed_on=day)
    for name, content in files.items():
        with recordings.receive(db, blobs, settings, None, session.id, name) as upload:
            upload.write(content)
            upload.keep()
    with db.write() as c:
        queue = TableQueue(db, settings.lease_s)
        recordings.set_manifest(c, None, session.id, {"sensors": dict(recording.segments)})
        recordings.inspect(c, queue, None, session.id)
        analyses.submit(c, queue, None, session.id)


if __name__ == "__main__":
    fill(load_settings())
