"""`sagittal trash`."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

from sagittal.server.commands.trash import trash
from sagittal.server.storage.files.blobs import BlobFile
from tests.faults.clinic import Clinic

AT = dt.datetime(2026, 3, 14, 3, 15, tzinfo=dt.UTC)


def discard(clinic: Clinic) -> BlobFile:
    """Move the stored file of the patient into the trash, as the sweep of a wrong database would."""
    (one,) = clinic.blobs.files()
    result = [(one.space, one.name)]
    clinic.blobs.trash.prepare(result, AT)
    clinic.blobs.trash.take(result, AT)
    clinic.blobs.trash.settle(result, AT)
    assert isinstance(one, BlobFile)
    return one


def test_the_trash_is_listed_with_the_day_on_which_each_file_goes(
    clinic: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    one = discard(clinic)
    assert trash(restore=False, data_dir=clinic.folder) == 0
    place = clinic.settings.trash
    assert capsys.readouterr().out == (
        f"2026-03-14 03:15Z, until 2026-04-13: 7 bytes, {place}/20260314T031500Z/{one.space}/{one.name}\n"
        f"1 files in {place}\n"
    )


def test_an_empty_trash_is_said(clinic: Clinic, capsys: pytest.CaptureFixture[str]) -> None:
    assert trash(restore=False, data_dir=clinic.folder) == 0
    assert capsys.readouterr().out == f"0 files in {clinic.settings.trash}\n"


def test_files_of_a_lost_database_are_listed_without_it(
    clinic: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    discard(clinic)
    clinic.db.close()
    for path in clinic.folder.glob("sagittal.db*"):
        path.unlink()
    assert trash(restore=False, data_dir=clinic.folder) == 0
    assert "1 files in" in capsys.readouterr().out
    assert trash(restore=True, data_dir=clinic.folder) == 1
    assert "There is no database in" in capsys.readouterr().err


def test_what_the_database_knows_is_put_back(clinic: Clinic, capsys: pytest.CaptureFixture[str]) -> None:
    one = discard(clinic)
    assert list(clinic.blobs.files()) == []
    assert trash(restore=True, data_dir=clinic.folder) == 0
    stdout = capsys.readouterr().out
    assert stdout == f"1 files that the database refers to are back in {clinic.settings.blobs}\n"
    assert clinic.blobs.read(one.space, one.name) == b"signals"


def test_a_folder_that_was_never_a_clinic_stays_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert trash(restore=False, data_dir=tmp_path) == 1
    assert "There is no database in" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
