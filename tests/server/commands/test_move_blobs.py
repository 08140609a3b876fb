"""`sagittal move-blobs`."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.server.commands.move_blobs import move_blobs
from sagittal.server.settings import SettingsError
from sagittal.server.storage import fs
from tests.faults.clinic import Clinic


def test_a_folder_without_stored_files_is_no_clinics(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert move_blobs(data_dir=tmp_path) == 1
    assert capsys.readouterr().err == (
        f"There are no stored files in {tmp_path}; give the folder with --data.\n"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("whose", ["lock", "workers_lock"])
def test_nothing_is_moved_under_a_running_server_or_worker(
    clinic: Clinic, whose: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with fs.Lock(getattr(clinic.settings, whose), "the server with pid 7"):
        assert move_blobs(data_dir=clinic.folder) == 1
    assert capsys.readouterr().err == f"{clinic.folder} is in use by the server with pid 7; stop it first.\n"
    assert len(list(clinic.blobs.files())) == 1


def test_without_a_bucket_it_says_how_one_is_named_and_lets_go_of_the_folder(clinic: Clinic) -> None:
    with pytest.raises(SettingsError, match=r"Set SAGITTAL_BUCKET .* s3://name/prefix"):
        move_blobs(data_dir=clinic.folder)
    assert len(list(clinic.blobs.files())) == 1
    with fs.Lock(clinic.settings.lock, "the next"), fs.Lock(clinic.settings.workers_lock, "the next"):
        pass
