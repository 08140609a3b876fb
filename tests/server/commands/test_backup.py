"""`sagittal backup`."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.server.clinic import identities
from sagittal.server.commands.backup import backup
from sagittal.server.safekeeping.backups import list_backups
from sagittal.server.storage.archive import make_key
from sagittal.server.storage.high_water import read_newest
from tests.faults.clinic import Clinic


def test_a_backup_is_said_with_its_size_and_the_end_of_the_audit_log(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    with clinic.db.read() as c:
        head = read_newest(c)
    assert head is not None
    assert backup(disk, prune=False, data_dir=clinic.folder) == 0
    (result,) = list_backups(disk)
    stdout = capsys.readouterr().out
    assert stdout.startswith(f"{result.path}: ")
    assert stdout.endswith(f" {result.path.stat().st_size} bytes, audit head {head.seq}:{head.hash}\n")


def test_a_key_of_names_that_is_not_in_it_is_told(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    identities.make_key(clinic.db, clinic.settings.identity_key_file)
    assert backup(tmp_path / "plain.tar", prune=False, data_dir=clinic.folder) == 0
    assert f"The key of patients' names, {clinic.settings.identity_key_file}, is not in it" in (
        capsys.readouterr().out
    )
    make_key(tmp_path / "clinic.key")
    assert backup(tmp_path / "safe.tar", key=tmp_path / "clinic.key", data_dir=clinic.folder) == 0
    assert "is not in it" not in capsys.readouterr().out


def test_old_backups_go_when_that_is_asked_for_and_nothing_else(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = [tmp_path / "disk" / f"sagittal-20200101T0{i}0000Z.tar" for i in (1, 2)]
    second = tmp_path / "disk" / "holiday.jpg"
    second.parent.mkdir()
    for path in (*old, second):
        path.touch()
    assert backup(second.parent, prune=False, data_dir=clinic.folder) == 0
    assert all(path.exists() for path in old)
    capsys.readouterr()
    assert backup(second.parent / "now.tar", prune=True, data_dir=clinic.folder) == 0
    assert f"removed {old[0]}\n" in capsys.readouterr().out
    assert not old[0].exists()
    assert second.exists()


def test_a_damaged_file_is_named_and_the_rest_is_kept(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (one,) = clinic.blobs.files()
    clinic.blobs.find_path(one).write_bytes(b"signalz")
    assert backup(tmp_path / "made.tar", prune=False, data_dir=clinic.folder) == 1
    captured = capsys.readouterr()
    assert captured.err == f"patient {one.space}: {one.name[:12]}… is gone or damaged; see `sagittal check`\n"
    assert (tmp_path / "made.tar").exists()


def test_without_a_usable_key_nothing_is_made(
    clinic: Clinic, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert backup(tmp_path / "made.tar", key=tmp_path / "none.key", data_dir=clinic.folder) == 1
    assert "none.key" in capsys.readouterr().err
    assert not (tmp_path / "made.tar").exists()
