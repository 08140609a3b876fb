"""`sagittal restore`."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from sagittal.server.clinic import identities, patients
from sagittal.server.commands.restore import _tell_names_key, restore
from sagittal.server.safekeeping.backups import IDENTITY_KEY, make_backup
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from tests.faults.clinic import Clinic


def test_a_backup_is_tried_and_then_put_into_an_empty_folder(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    backup = make_backup(clinic.db, clinic.settings, tmp_path / "made.tar", None)
    home = tmp_path / "again"
    assert restore(backup.path, data_dir=home, test=True) == 0
    tried = capsys.readouterr().out
    assert tried.startswith("It could be restored: the clinic of ")
    assert not (home / "sagittal.db").exists()
    # the trial leaves nothing in whose way the restore would be
    assert restore(backup.path, data_dir=home, test=False) == 0
    assert capsys.readouterr().out == tried.replace("It could be restored", f"Restored into {home}")
    assert "1 patients, 1 visits, 1 files; every hash" in tried
    with closing(Database(home / "sagittal.db")) as db, db.read() as c:
        assert patients.get(c, clinic.patient.id).code == "P-1"


def test_a_folder_that_holds_a_clinic_is_refused(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    backup = make_backup(clinic.db, clinic.settings, tmp_path / "made.tar", None)
    assert restore(backup.path, data_dir=clinic.folder, test=False) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "is not empty" in captured.err


def test_a_folder_that_holds_a_backup_is_refused(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    backup = make_backup(clinic.db, clinic.settings, tmp_path / "made.tar", None)
    retained = tmp_path / "again" / "backups" / "sagittal-20260314T031500Z.tar"
    retained.parent.mkdir(parents=True)
    retained.touch()
    assert restore(backup.path, data_dir=tmp_path / "again", test=False) == 1
    assert "is not empty (backups)" in capsys.readouterr().err


def test_files_that_were_gone_already_are_told(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (one,) = clinic.blobs.files()
    clinic.blobs.find_path(one).unlink()
    backup = make_backup(clinic.db, clinic.settings, tmp_path / "made.tar", None)
    assert restore(backup.path, data_dir=tmp_path / "again", test=True) == 0
    assert "1 files were gone when the backup was made; see `sagittal check`.\n" in capsys.readouterr().out


def test_who_restores_without_the_key_of_names_is_told_where_it_has_to_be(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    identities.make_key(clinic.db, clinic.settings.identity_key_file)
    with clinic.db.write() as c:
        identities.change(c, clinic.settings.identity_key_file, None, clinic.patient.id, {"name": "Erika"})
    plain = make_backup(clinic.db, clinic.settings, tmp_path / "plain.tar", None).path
    assert restore(plain, data_dir=tmp_path / "one", test=False) == 0
    place = tmp_path / "one" / "identity.key"
    assert f"was not in the backup. It has to be at {place};" in capsys.readouterr().out


def test_a_key_of_names_that_came_with_the_backup_goes_where_the_settings_have_it(tmp_path: Path) -> None:
    came, place = tmp_path / IDENTITY_KEY, tmp_path / "vault.key"
    address, elsewhere = Settings(data_dir=tmp_path), Settings(data_dir=tmp_path, identity_key=str(place))
    assert _tell_names_key(elsewhere) == ""  # none came
    came.write_bytes(b"of the backup")
    assert _tell_names_key(address) == ""
    move = f"The key of patients' names lies in {came}. Move it to {place}.\n"
    assert _tell_names_key(elsewhere) == move
    place.write_bytes(b"of the backup")
    assert _tell_names_key(elsewhere) == move
    place.write_bytes(b"of another database")
    assert f"another one is at {place}. Keep that one aside" in _tell_names_key(elsewhere)
