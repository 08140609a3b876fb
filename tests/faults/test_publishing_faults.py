"""The disk refuses in the middle of an upload or a publication: no row without its file, a retry works."""

from __future__ import annotations

import errno
import threading
from collections.abc import Callable
from dataclasses import replace

import pytest

from sagittal.core.errors import SagittalError
from sagittal.server.safekeeping import checks
from sagittal.server.safekeeping.sweep import sweep
from sagittal.server.storage import fs
from sagittal.server.uploads import receiving, recordings
from sagittal.server.worker.task import load
from sagittal.server.worker.worker import Worker
from tests.faults.clinic import Clinic
from tests.faults.failing import FailingSystem
from tests.helpers.engines import on_both_engines
from tests.helpers.marks import sqlite_only


def fail_at_every_call(
    monkeypatch: pytest.MonkeyPatch, act: Callable[[], bool], later: Callable[[bool], None]
) -> int:
    """Repeat `act` with the first, second … call failing until it passes; returns the number of failures."""
    failures = 0
    while True:
        monkeypatch.setattr(fs, "system", FailingSystem(failures + 1, errno.ENOSPC))
        passed = act()
        monkeypatch.setattr(fs, "system", fs.System())
        later(passed)
        if passed:
            return failures
        failures += 1


@pytest.mark.death
@on_both_engines
def test_an_upload_that_fails_anywhere_leaves_no_row_and_can_be_sent_again(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    def upload() -> bool:
        try:
            with receiving.receive(
                clinic.db, clinic.blobs, clinic.settings, None, clinic.session.id, "b.txt"
            ) as incoming:
                incoming.write(b"first half, ")
                incoming.write(b"second half")
                incoming.keep()
        except OSError:
            return False
        return True

    def after(passed: bool) -> None:
        assert checks.check(clinic.db, clinic.blobs, clinic.settings) == []
        with clinic.db.read() as c:
            names = [f.name for f in recordings.require_current(c, clinic.session.id).files]
        assert ("b.txt" in names) is passed

    assert fail_at_every_call(monkeypatch, upload, after) >= 5
    assert sweep(clinic.db, clinic.blobs, replace(clinic.settings, sweep_grace_s=0.0)) == 0


@on_both_engines
def test_a_result_that_cannot_be_stored_fails_its_job_with_a_reason(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    # its first sweep writes the file of a lock, which is not the call that is to fail
    monkeypatch.setattr("sagittal.server.worker.worker.sweep", lambda *_: 0)
    load(clinic.settings.task_modules)
    stop = threading.Event()
    worker = Worker(clinic.settings, clinic.db, clinic.blobs, clinic.queue, stop)
    thread = threading.Thread(target=worker.run)
    thread.start()

    def work() -> bool:
        view = clinic.ended(clinic.submit())
        assert view.state == "done" or view.error_code == "not_stored"
        return view.state == "done"

    def after(passed: bool) -> None:
        assert len(clinic.results()) == int(passed)
        assert checks.check(clinic.db, clinic.blobs, clinic.settings) == []

    try:
        assert fail_at_every_call(monkeypatch, work, after) >= 4
    finally:
        stop.set()
        thread.join()


@on_both_engines
def test_a_file_swept_before_its_row_was_written_is_noticed(clinic: Clinic) -> None:
    with receiving.receive(
        clinic.db, clinic.blobs, clinic.settings, None, clinic.session.id, "b.txt"
    ) as upload:
        upload.write(b"content")
        stored_keep = upload._receiver.keep

        def keep_and_lose() -> object:
            blob = stored_keep()
            clinic.blobs.path(clinic.patient.id, blob.sha256).unlink()
            return blob

        upload._receiver.keep = keep_and_lose  # type: ignore[method-assign, assignment]
        with pytest.raises(SagittalError, match="is not there"):
            upload.keep()
    assert checks.check(clinic.db, clinic.blobs, clinic.settings) == []


def write_notes(clinic: Clinic, times: int) -> None:
    for i in range(times):
        with clinic.db.write() as c:
            c.exec_driver_sql("UPDATE patient SET note = ?", (f"{i:08}" * 8000,))


@sqlite_only
def test_a_reader_that_holds_its_snapshot_stops_nobody_and_the_log_shrinks_after(clinic: Clinic) -> None:
    log = clinic.settings.database.with_name("sagittal.db-wal")
    with clinic.db.read() as reader:
        reader.exec_driver_sql("SELECT count(*) FROM patient").scalar_one()
        write_notes(clinic, 100)
        grown = log.stat().st_size
    write_notes(clinic, 100)
    assert log.stat().st_size < 1.2 * grown  # the log was started anew
    clinic.db.close()
    assert not log.exists()
