"""A truncated audit log is a valid chain; `check` detects the truncation."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from sagittal.server.clinic import patients
from sagittal.server.commands.check import check
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.high_water import raise_mark, set_mark
from tests.helpers.databases import write_database

ROWS = 6


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    """A data folder whose audit log has six rows, and the mark that a server leaves."""
    result = Settings(data_dir=tmp_path)
    write_database(result.database)
    with closing(Database(result.database)) as db:
        with db.write() as c:
            for i in range(ROWS):
                patients.create(c, None, code=f"P-{i}")
        raise_mark(db, result.mark)
    return result


def cut(settings: Settings, retained: int) -> Database:
    """Remove the newest rows like an attacker with file access."""
    db = Database(settings.database)
    with db.write() as c:
        c.exec_driver_sql("DROP TRIGGER audit_no_delete")
        c.exec_driver_sql("DELETE FROM audit WHERE seq > ?", (retained,))
    return db


def test_a_whole_log_is_well(settings: Settings, capsys: pytest.CaptureFixture[str]) -> None:
    assert check(data_dir=settings.data_dir) == 0
    assert capsys.readouterr().out == "All is well.\n"


def test_a_head_kept_elsewhere_tells_what_no_file_of_the_folder_can(
    settings: Settings, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    head = tmp_path / "elsewhere.json"
    head.write_bytes(settings.mark.read_bytes())
    assert check(data_dir=settings.data_dir, head=head) == 0
    with closing(cut(settings, 3)) as db:
        with db.write() as c:
            c.exec_driver_sql("UPDATE sqlite_sequence SET seq = 3 WHERE name = 'audit'")
        set_mark(db, settings.mark)
    capsys.readouterr()
    assert check(data_dir=settings.data_dir) == 0  # whoever may write all files has hidden it
    assert check(data_dir=settings.data_dir, head=head) == 1
    assert "The audit log ends at row 3, but had reached row 6" in capsys.readouterr().out
    assert check(data_dir=settings.data_dir, head=tmp_path / "lost.json") == 1


@pytest.mark.parametrize("kept", [0, 3, ROWS - 1])
def test_a_cut_end_is_noticed_without_the_mark(
    settings: Settings, kept: int, capsys: pytest.CaptureFixture[str]
) -> None:
    settings.mark.unlink()
    cut(settings, kept).close()
    assert check(data_dir=settings.data_dir) == 1
    stdout = capsys.readouterr().out
    assert f"audit: audit rows {kept + 1} to {ROWS}, the newest, have been removed" in stdout


@pytest.mark.parametrize("kept", [0, 3, ROWS - 1])
def test_a_cut_end_is_noticed_by_the_mark_when_the_tables_own_number_was_set_back_too(
    settings: Settings, kept: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with closing(cut(settings, kept)) as db, db.write() as c:
        c.exec_driver_sql("UPDATE sqlite_sequence SET seq = ? WHERE name = 'audit'", (kept,))
    assert check(data_dir=settings.data_dir) == 1
    stdout = capsys.readouterr().out
    assert f"audit: The audit log ends at row {kept}, but had reached row {ROWS}" in stdout


def test_an_end_that_was_written_anew_is_noticed(
    settings: Settings, capsys: pytest.CaptureFixture[str]
) -> None:
    with closing(cut(settings, 3)) as db, db.write() as c:
        for i in range(ROWS):
            patients.create(c, None, code=f"N-{i}")
    assert check(data_dir=settings.data_dir) == 1
    assert f"audit: Audit row {ROWS} is not the one that was here before" in capsys.readouterr().out
