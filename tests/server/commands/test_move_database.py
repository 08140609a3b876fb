"""`sagittal move-database`: refusals before anything is moved; storage/test_postgres.py tests the move."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.server.commands.move_database import move_database
from sagittal.server.storage import fs
from tests.faults.clinic import Clinic

NOWHERE = "postgresql://nobody@127.0.0.1:9/clinic"


@pytest.fixture
def named(monkeypatch: pytest.MonkeyPatch, clinic: Clinic) -> None:
    """The environment names a database."""
    monkeypatch.setenv("SAGITTAL_DATABASE_URL", NOWHERE)


def test_it_needs_the_name_of_the_other_database(clinic: Clinic, capsys: pytest.CaptureFixture[str]) -> None:
    assert move_database(data_dir=clinic.folder) == 1
    assert capsys.readouterr().err.startswith("Set SAGITTAL_DATABASE_URL to the empty PostgreSQL database")
    assert clinic.settings.database.exists()


@pytest.mark.usefixtures("named")
def test_a_folder_without_a_database_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert move_database(data_dir=tmp_path) == 1
    assert capsys.readouterr().err == (
        f"There is no {tmp_path / 'sagittal.db'}; give the folder with --data.\n"
    )


@pytest.mark.usefixtures("named")
def test_an_old_file_that_lies_aside_is_not_overwritten(
    clinic: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    aside = clinic.settings.backups / "before-postgresql.db"
    aside.parent.mkdir()
    aside.write_bytes(b"of an earlier move")
    assert move_database(data_dir=clinic.folder) == 1
    assert capsys.readouterr().err == f"{aside} exists already; put it elsewhere first.\n"
    assert aside.read_bytes() == b"of an earlier move"


@pytest.mark.usefixtures("named")
@pytest.mark.parametrize("whose", ["lock", "workers_lock"])
def test_nothing_is_moved_under_a_running_server_or_worker(
    clinic: Clinic, whose: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with fs.Lock(getattr(clinic.settings, whose), "the server with pid 7"):
        assert move_database(data_dir=clinic.folder) == 1
    assert capsys.readouterr().err == f"{clinic.folder} is in use by the server with pid 7; stop it first.\n"
    assert clinic.settings.database.exists()
