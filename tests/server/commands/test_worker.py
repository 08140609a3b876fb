"""`sagittal worker`: what keeps it from beginning; its work is in jobs/ and faults/."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest

from sagittal.server.commands.worker import worker
from sagittal.server.storage import fs
from tests.faults.clinic import Clinic


@pytest.fixture(autouse=True)
def own_process_again() -> Iterator[None]:
    """Restore the test process's settings that commands may change."""
    mask = os.umask(0o022)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    yield
    os.umask(mask)
    for number, handler in handlers.items():
        signal.signal(number, handler)


def test_a_folder_that_somebody_moves_is_left_to_them(
    clinic: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    with fs.Lock(clinic.settings.workers_lock, "a move of stored files"):
        assert worker(data_dir=clinic.folder) == 1
    assert capsys.readouterr().err.endswith(
        f"{clinic.folder} is in use by a move of stored files; start this worker after it.\n"
    )


def test_a_database_of_a_newer_version_is_refused(clinic: Clinic, capsys: pytest.CaptureFixture[str]) -> None:
    with clinic.db.write() as c:
        c.exec_driver_sql("UPDATE alembic_version SET version_num = 'of_tomorrow'")
    assert worker(data_dir=clinic.folder) == 1
    assert "of_tomorrow" in capsys.readouterr().err


def test_what_a_worker_writes_nobody_else_may_read(clinic: Clinic) -> None:
    with fs.Lock(clinic.settings.workers_lock, "a move of stored files"):
        worker(data_dir=clinic.folder)
    assert os.umask(0o022) == 0o077
