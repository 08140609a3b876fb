"""The kinds of job of this version, and what becomes of a recording that was looked into."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from sagittal.core.errors import FormatError
from sagittal.server.errors import Conflict
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.jobs.queue import BESIDE, COMPARE_FILTERS, EXPORT, SENSITIVITY, TUNE
from sagittal.server.results import tunings
from sagittal.server.settings import Settings
from sagittal.server.storage.files.blob_source import open_source
from sagittal.server.uploads import receiving, recordings
from sagittal.server.worker import tasks
from sagittal.server.worker.task import TASKS, load
from tests.faults.clinic import Clinic

load(Settings(data_dir=Path()).task_modules)


@pytest.fixture
def clinic(tmp_path: Path) -> Iterator[Clinic]:
    new_clinic = Clinic(tmp_path / "home", lease_s=30.0, database_url="")
    yield new_clinic
    new_clinic.db.close()


def quiet(*message: object) -> None:
    """Worker without notifications."""


ATTEMPT = Attempt(quiet, quiet)


def test_every_kind_of_job_has_its_task_and_tables_alone_keep_no_files() -> None:
    reference = {recordings.INSPECT, recordings.ANALYSE, *BESIDE}
    assert reference <= set(TASKS)
    assert {kind for kind in reference if TASKS[kind].keeps_files} == {
        recordings.ANALYSE, COMPARE_FILTERS, SENSITIVITY, EXPORT
    }  # fmt: skip
    assert TASKS[TUNE].publish is tunings.publish
    assert all(TASKS[kind].kind == kind for kind in reference)


def test_what_was_found_in_a_recording_stays_with_it(clinic: Clinic) -> None:
    task = TASKS[recordings.INSPECT]
    with clinic.db.write() as c:
        recordings.inspect(c, clinic.queue, None, clinic.session.id)
    claim = clinic.queue.claim("test", [recordings.INSPECT])
    assert claim is not None
    results = {tasks.FOUND: b'{"sensors": []}'}
    assert clinic.queue.finish(claim, lambda c: task.publish(c, claim, results, {}))
    with clinic.db.read() as c:
        current = recordings.require_current(c, clinic.session.id)
    assert current.state == "ready"
    assert current.inspection == {"sensors": []}


def test_a_text_is_no_recording_and_is_refused_by_its_reader(clinic: Clinic) -> None:
    (stored,) = clinic.blobs.files()
    source = open_source(clinic.blobs, stored.space, "a.txt", 7, stored.name)
    with pytest.raises(FormatError) as refused:
        TASKS[recordings.INSPECT].run([source], {"manifest": None}, ATTEMPT)
    assert refused.value.code == "unknown_format"


def test_what_was_found_in_files_that_were_changed_since_is_not_kept(clinic: Clinic) -> None:
    task = TASKS[recordings.INSPECT]
    with clinic.db.write() as c:
        recordings.inspect(c, clinic.queue, None, clinic.session.id)
    claim = clinic.queue.claim("test", [recordings.INSPECT])
    assert claim is not None
    with receiving.receive(
        clinic.db, clinic.blobs, clinic.settings, None, clinic.session.id, "b.txt"
    ) as upload:
        upload.write(b"more signals")
        upload.keep()
    with pytest.raises(Conflict) as refused, clinic.db.write() as c:
        task.publish(c, claim, {tasks.FOUND: b"{}"}, {})
    assert refused.value.code == "files_changed"
