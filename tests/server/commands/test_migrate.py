"""`sagittal migrate`."""

from __future__ import annotations

import pytest

from sagittal.server.commands.migrate import migrate
from tests.faults.clinic import Clinic


def test_a_current_database_is_left_without_a_backup(
    clinic: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    assert migrate(data_dir=clinic.folder) == 0
    assert capsys.readouterr().out == "The database is current.\n"
    assert not clinic.settings.backups.exists()


def test_a_database_of_a_newer_version_is_refused(clinic: Clinic, capsys: pytest.CaptureFixture[str]) -> None:
    with clinic.db.write() as c:
        c.exec_driver_sql("UPDATE alembic_version SET version_num = 'of_tomorrow'")
    assert migrate(data_dir=clinic.folder) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "of_tomorrow" in captured.err
    with clinic.db.read() as c:
        assert c.exec_driver_sql("SELECT version_num FROM alembic_version").scalar() == "of_tomorrow"
