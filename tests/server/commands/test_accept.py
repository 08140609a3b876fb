"""`sagittal accept`."""

from __future__ import annotations

from pathlib import Path

import pytest
from sqlalchemy import select

from sagittal.server.commands.accept import accept
from sagittal.server.safekeeping import custody
from sagittal.server.storage.high_water import explain_lost_rows, set_mark
from sagittal.server.storage.schema.tables import audit
from tests.faults.clinic import Clinic


def actions(clinic: Clinic) -> list[str]:
    with clinic.db.read() as c:
        return list(c.execute(select(audit.c.action).order_by(audit.c.seq)).scalars())


def test_a_database_that_nobody_doubts_is_left_as_it_is(
    clinic: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    initial = actions(clinic)
    assert accept(data_dir=clinic.folder) == 0
    assert capsys.readouterr().out == "There was no doubt about this database; nothing is changed.\n"
    assert actions(clinic) == initial


def test_a_database_that_has_lost_rows_is_the_right_one_from_then_on(
    clinic: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    set_mark(clinic.db, clinic.settings.mark)
    known_text = clinic.settings.mark.read_text()
    rows = len(actions(clinic))
    clinic.settings.mark.write_text(known_text.replace(f": {rows}", f": {rows + 7}"))
    assert accept(data_dir=clinic.folder) == 0
    stdout = capsys.readouterr().out
    assert f"ends at row {rows}, but had reached row {rows + 7}" in stdout
    assert (
        f"go to {clinic.settings.trash} and stay 30 days; live logs stay in {clinic.settings.live}." in stdout
    )
    assert actions(clinic)[-1] == custody.ACCEPTED
    with clinic.db.read() as c:
        assert explain_lost_rows(c, clinic.settings.mark) is None


def test_an_empty_folder_gets_no_database(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert accept(data_dir=tmp_path) == 1
    assert capsys.readouterr().err == f"There is no database in {tmp_path}; give the folder with --data.\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_files_without_their_database_can_be_given_up_for_a_new_beginning(
    clinic: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    clinic.db.close()
    for path in clinic.folder.glob("sagittal.db*"):
        path.unlink()
    with pytest.raises(custody.StrangersError):
        custody.refuse_strangers(clinic.settings)
    assert accept(data_dir=clinic.folder) == 0
    assert "knows no patient, but 1 stored files and 0 live logs are there." in capsys.readouterr().out
    custody.refuse_strangers(clinic.settings)
    assert clinic.settings.database.exists()
