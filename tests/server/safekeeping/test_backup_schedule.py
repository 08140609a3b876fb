"""Backups by the clock, and the weekly restore test."""

from __future__ import annotations

import datetime as dt
import json
from dataclasses import replace
from pathlib import Path

import pytest

from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import backup_schedule, erasure
from sagittal.server.safekeeping.backup_schedule import BackupState, Outcome, is_due, next_time, read_state
from sagittal.server.safekeeping.backups import list_backups
from sagittal.server.settings import Settings
from sagittal.server.storage.archive import make_key
from sagittal.server.storage.db import Database
from sagittal.server.worker.backing_up import BackupKeeper
from tests.faults.clinic import Clinic

ZONE = dt.timezone(dt.timedelta(hours=2))


def at(day: int, hour: int, minute: int = 0) -> dt.datetime:
    return dt.datetime(2026, 3, day, hour, minute, tzinfo=ZONE)


def note(settings: Settings, **outcomes: Outcome) -> None:
    backup_schedule._write(settings, BackupState(**outcomes))


def test_a_backup_is_due_once_a_day_and_an_hour_after_a_failure(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path / "home", backup_dir="/mnt/backup", backup_at="02:30")
    settings.data_dir.mkdir()
    assert not is_due(replace(settings, backup_dir=""), at(3, 12))
    assert is_due(settings, at(3, 12))  # none yet
    good = Outcome(at(3, 2, 35), True, "x.tar", "", 9)
    note(settings, backup=good, good=good)
    assert not is_due(settings, at(3, 12))
    assert not is_due(settings, at(4, 2, 29))
    assert is_due(settings, at(4, 2, 31))
    assert is_due(settings, at(9, 1))  # the computer was off
    bad = Outcome(at(4, 2, 35), False, "", "no disk")
    note(settings, backup=bad, good=good)
    assert not is_due(settings, at(4, 3))
    assert is_due(settings, at(4, 3, 36))
    assert next_time(settings, at(4, 2)) == at(4, 2, 30)
    assert next_time(settings, at(4, 3)) == at(5, 2, 30)
    settings.backup_state.write_text("{")
    assert read_state(settings) == BackupState()


@pytest.mark.slow
def test_the_newest_backup_is_restored_every_week_and_the_result_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clinic = Clinic(tmp_path / "home", lease_s=5.0)
    disk = tmp_path / "disk"
    settings = replace(clinic.settings, backup_dir=str(disk), backup_key=str(tmp_path / "key"))
    public = make_key(tmp_path / "key")
    first = backup_schedule.run(settings)
    assert first.backup is not None
    assert not first.backup.ok
    assert "There is no folder" in first.backup.said
    assert first.test is None
    disk.mkdir()
    second = backup_schedule.run(settings)
    assert second == read_state(settings)
    assert second.good is not None
    assert second.test is not None
    assert second.test.ok
    assert (second.test.name, second.test.said) == (second.good.name, "1 patients, 1 visits, 1 files.")
    assert sorted(p.name for p in settings.backups.iterdir()) == ["lock"]
    # not again before a week is over
    now = second.test.at
    monkeypatch.setattr(backup_schedule, "now", lambda: now + dt.timedelta(days=6))
    list_backups(disk)[0].path.unlink()
    assert backup_schedule.run(settings).test == second.test
    monkeypatch.setattr(backup_schedule, "now", lambda: now + dt.timedelta(days=7))
    list_backups(disk)[0].path.unlink()
    third = backup_schedule.run(settings)
    assert third.test != second.test
    # a key that only encrypts: not tested here, and said so
    (tmp_path / "key").write_text(public)
    list_backups(disk)[0].path.unlink()
    monkeypatch.setattr(backup_schedule, "now", lambda: now + dt.timedelta(days=20))
    fourth = backup_schedule.run(settings).test
    assert fourth is not None
    assert (fourth.ok, fourth.said) == (None, backup_schedule.NOT_TESTED)
    clinic.db.close()


def test_who_is_erased_is_on_the_list_beside_the_backups_at_once(tmp_path: Path) -> None:
    clinic = Clinic(tmp_path / "home", lease_s=5.0)
    (tmp_path / "disk").mkdir()
    settings = replace(clinic.settings, backup_dir=str(tmp_path / "disk"))
    good = Outcome(dt.datetime.now(dt.UTC), True, "x.tar", "", 9)
    note(settings, backup=good, good=good)
    keeper, db = BackupKeeper(settings), Database(settings.database_source)
    keeper._look(db)
    listed = tmp_path / "disk" / "erased.json"
    assert json.loads(listed.read_text()) == {"patients": [], "sessions": []}
    patient = clinic.patient.id
    erasure.erase_patient(db, ReviewedAnalyses(clinic.blobs), settings, None, patient, confirm="P-1")
    keeper._look(db)
    assert json.loads(listed.read_text())["patients"] == [patient]
    db.close()
    clinic.db.close()
