"""A clinic whose stored files are in a bucket: trash, erasure, check, backup, restore, move, jobs."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import delete

from sagittal.server.main import main
from sagittal.server.processes.supervisor import Workers
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import backup_schedule, backups, checks, erasure, sweep
from sagittal.server.safekeeping.restore_room import RestoreError
from sagittal.server.safekeeping.restoring import restore
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_bucket import BucketBlobs
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.files.blob_opening import open_blobs
from sagittal.server.storage.files.blobs import StoreAway
from sagittal.server.storage.schema.tables import recording_file
from sagittal.server.uploads import receiving, uploads
from tests.faults.clinic import Clinic, until
from tests.helpers.buckets import Bucket, bucket, s3_server  # noqa: F401 - fixtures


@pytest.fixture
def clinic(tmp_path: Path, bucket: Bucket) -> Iterator[Clinic]:  # noqa: F811
    new_clinic = Clinic(tmp_path / "home", lease_s=5.0, database_url="", bucket=bucket.url)
    yield new_clinic
    new_clinic.db.close()


def findings(clinic: Clinic) -> list[str]:
    result = checks.check(clinic.db, clinic.blobs, clinic.settings)
    return [f"{f.area}: {f.message}" for f in result]


def at_once(clinic: Clinic) -> Settings:
    return replace(clinic.settings, sweep_grace_s=0.0)


def sweep_now(clinic: Clinic) -> int:
    return sweep.sweep(clinic.db, clinic.blobs, at_once(clinic))


def upload(clinic: Clinic, name: str, content: bytes) -> None:
    with receiving.receive(clinic.db, clinic.blobs, clinic.settings, None, clinic.session.id, name) as coming:
        coming.write(content)
        coming.keep()


def environment(clinic: Clinic, monkeypatch: pytest.MonkeyPatch) -> None:
    """Environment for commands of this clinic."""
    monkeypatch.setenv("SAGITTAL_BUCKET", clinic.settings.bucket)
    monkeypatch.setenv("SAGITTAL_HOME", str(clinic.folder))


@pytest.mark.slow
def test_what_nothing_refers_to_goes_to_the_trash_and_comes_back(clinic: Clinic, bucket: Bucket) -> None:  # noqa: F811
    stray = clinic.blobs.put(clinic.patient.id, b"of nobody")
    assert sweep.sweep(clinic.db, clinic.blobs, clinic.settings) == 0  # it is young
    assert sweep_now(clinic) == 1
    [key] = [key for key in bucket.objects() if key.startswith("trash/")]
    assert key.endswith(f"/{clinic.patient.id}/{stray.sha256}")
    assert len(bucket.objects()) == 2
    assert sweep_now(clinic) == 0
    assert findings(clinic) == []
    bucket.write(key, b"of somebodi")
    assert "has changed" in findings(clinic)[0]
    bucket.write(key, b"of nobody")
    [expected] = [f for f in clinic.blobs.files() if f.space == clinic.patient.id]
    address = (expected.space, expected.name)
    [position] = {one.since for one in clinic.blobs.trash.files()}
    clinic.blobs.trash.prepare([address], position)
    clinic.blobs.trash.take([address], position)
    assert "lies in the trash" in findings(clinic)[0]
    assert sweep.put_back(clinic.db, clinic.blobs) == 1
    assert findings(clinic) == []


@pytest.mark.slow
def test_a_database_that_went_back_takes_no_file(clinic: Clinic, bucket: Bucket) -> None:  # noqa: F811
    with clinic.db.write() as c:
        c.execute(delete(recording_file))
    clinic.settings.mark.write_bytes(b"\0" * 40)
    initial = bucket.objects()
    assert sweep_now(clinic) == 0
    assert bucket.objects() == initial


def test_an_erased_patient_leaves_no_object_not_even_in_the_trash(clinic: Clinic, bucket: Bucket) -> None:  # noqa: F811
    clinic.blobs.put(clinic.patient.id, b"of nobody")
    assert sweep_now(clinic) == 1
    assert len(bucket.objects()) == 2
    erasure.erase_patient(
        clinic.db, ReviewedAnalyses(clinic.blobs), clinic.settings, None, clinic.patient.id, confirm="P-1"
    )
    assert bucket.objects() == set()


def test_an_erasure_while_the_store_is_away_is_finished_when_it_is_back(
    clinic: Clinic,
    bucket: Bucket,  # noqa: F811
) -> None:
    bucket.server.stop()
    erasure.erase_patient(
        clinic.db, ReviewedAnalyses(clinic.blobs), clinic.settings, None, clinic.patient.id, confirm="P-1"
    )
    bucket.server.start()
    assert len(bucket.objects()) == 1
    sweep_now(clinic)
    assert bucket.objects() == set()
    assert list(clinic.settings.erasing.iterdir()) == []


@pytest.mark.slow
def test_the_check_finds_damage_and_says_in_one_sentence_when_it_cannot_look(
    clinic: Clinic,
    bucket: Bucket,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    environment(clinic, monkeypatch)
    assert main(["check"]) == 0
    [key] = bucket.objects()
    bucket.write(key, b"signalz")
    assert main(["check"]) == 1
    assert "has changed on the disk" in capsys.readouterr().out
    bucket.server.stop()
    assert main(["check"]) == 1
    message = capsys.readouterr().err.splitlines()
    assert [line for line in message if "cannot be reached" in line] == message[-1:]
    bucket.server.start()
    monkeypatch.delenv("SAGITTAL_BUCKET")
    assert main(["check"]) == 2
    assert f"Set SAGITTAL_BUCKET={bucket.url}" in capsys.readouterr().err


@pytest.mark.slow
def test_a_backup_has_the_bucket_and_goes_into_a_folder_and_into_an_empty_bucket(
    clinic: Clinic,
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    backup = backups.make_backup(clinic.db, clinic.settings, disk, None)
    assert (backup.files, backup.missing) == (1, [])
    target = bucket.url + "-again"
    for name, url in (("folder", ""), ("bucket", target)):
        home = replace(clinic.settings, data_dir=tmp_path / name, bucket=url)
        assert restore(backup.path, home, None).files == 1
        with closing(Database(home.database)) as db:
            assert checks.check(db, open_blobs(home), home) == []
        assert not home.restoring.exists()
    for selection in (bucket.url, target):
        home = replace(clinic.settings, data_dir=tmp_path / "another", bucket=selection)
        with pytest.raises(RestoreError, match="is not empty"):
            restore(backup.path, home, None)
        assert sorted(p.name for p in home.data_dir.iterdir()) == ["server.lock"]
    bucket.server.stop()
    with pytest.raises(backups.BackupError, match="cannot be read"):
        backups.make_backup(clinic.db, clinic.settings, disk / "sagittal.tar", None)
    assert not (disk / "sagittal.tar").exists()


def test_the_weekly_test_restores_what_was_in_the_bucket(clinic: Clinic, tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    state = backup_schedule.run(replace(clinic.settings, backup_dir=str(tmp_path / "disk")))
    assert state.test is not None
    assert (state.test.ok, state.test.said) == (True, "1 patients, 1 visits, 1 files.")


@pytest.mark.slow
def test_a_restore_into_a_bucket_that_was_cut_off_is_made_again(
    clinic: Clinic,
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    upload(clinic, "b.txt", b"more signals")
    (tmp_path / "disk").mkdir()
    backup = backups.make_backup(clinic.db, clinic.settings, tmp_path / "disk", None)
    home = replace(clinic.settings, data_dir=tmp_path / "again", bucket=bucket.url + "-again")
    adopt = BucketBlobs.adopt

    def adopt_one(self: BucketBlobs, space: str, path: Path, sha256: str) -> None:
        adopt(self, space, path, sha256)
        bucket.server.stop()

    monkeypatch.setattr(BucketBlobs, "adopt", adopt_one)
    with pytest.raises(RestoreError, match="Mend that and restore again"):
        restore(backup.path, home, None)
    monkeypatch.setattr(BucketBlobs, "adopt", adopt)
    bucket.server.start()
    assert not home.database.exists()
    assert restore(backup.path, home, None).files == 2
    with closing(Database(home.database)) as db:
        assert checks.check(db, open_blobs(home), home) == []
    assert not home.restoring.exists()


@pytest.mark.slow
def test_a_move_into_the_bucket_goes_on_where_it_was_cut_off(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    clinic = Clinic(tmp_path / "home", lease_s=5.0, database_url="")
    upload(clinic, "b.txt", b"more signals")
    clinic.blobs.put(clinic.patient.id, b"of nobody")
    assert sweep_now(clinic) == 1
    target = replace(clinic.settings, bucket=bucket.url)
    clinic.settings = target
    environment(clinic, monkeypatch)
    assert main(["check"]) == 2
    assert "Run `sagittal move-blobs` first" in capsys.readouterr().err
    put = BucketBlobs.adopt

    def put_one(self: BucketBlobs, space: str, path: Path, sha256: str) -> None:
        put(self, space, path, sha256)
        bucket.server.stop()

    monkeypatch.setattr(BucketBlobs, "adopt", put_one)
    assert main(["move-blobs"]) == 1
    monkeypatch.setattr(BucketBlobs, "adopt", put)
    bucket.server.start()
    assert main(["check"]) == 2
    assert "was interrupted" in capsys.readouterr().err
    assert main(["move-blobs"]) == 0
    assert "read back" in capsys.readouterr().out
    assert len(bucket.objects()) == 3
    left = [p for p in (*target.blobs.rglob("*"), *target.trash.rglob("*")) if p.is_file()]
    assert sorted(p.name for p in left) == ["bucket.txt", "list.txt"]
    assert main(["check"]) == 0
    late = FolderBlobs(target.blobs).put(clinic.patient.id, b"of a worker that nobody had stopped")
    assert main(["move-blobs"]) == 0
    assert "1 stored files" in capsys.readouterr().out
    clinic.blobs = open_blobs(target)
    assert clinic.blobs.has(clinic.patient.id, late.sha256)
    assert findings(clinic) == []
    clinic.db.close()


def test_a_move_leaves_what_is_damaged_and_wants_an_empty_prefix(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    clinic = Clinic(tmp_path / "home", lease_s=5.0, database_url="")
    [stored] = clinic.blobs.files()
    clinic.blobs.find_path(stored).write_bytes(b"signalz")
    clinic.settings = replace(clinic.settings, bucket=bucket.url)
    environment(clinic, monkeypatch)
    bucket.write("another's", b"file")
    assert main(["move-blobs"]) == 2
    assert "is not empty" in capsys.readouterr().err
    monkeypatch.setenv("SAGITTAL_BUCKET", bucket.url + "-of-ours")
    assert main(["move-blobs"]) == 1
    assert "is damaged and was left" in capsys.readouterr().err
    assert clinic.blobs.find_path(stored).exists()
    assert main(["check"]) == 1
    clinic.db.close()


@pytest.mark.slow
def test_a_job_waits_for_the_store_and_is_done_when_it_is_back(
    clinic: Clinic,
    bucket: Bucket,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PYTHONWARNINGS", "error")
    workers = Workers(clinic.settings)
    workers.start()
    try:
        # away before its result is stored, and then while another reads its files
        view, reached, gate = clinic.hold("third")
        until(reached.exists)
        bucket.server.stop()
        gate.touch()
        until(lambda: clinic.row(view).state == "queued")
        until(lambda: clinic.row(view).attempt >= 3)  # it is claimed again, and costs no death
        assert clinic.row(view).deaths == 0
        bucket.server.start()
        done = clinic.ended(view)
        assert (done.state, done.error_code, done.attempt) == ("done", None, 1)
        [result] = clinic.results()
        assert clinic.blobs.read(clinic.patient.id, result.files["result.txt"].sha256) == b"signals"
    finally:
        workers.stop()


def test_an_upload_in_parts_is_finished_when_the_store_is_back(
    clinic: Clinic,
    bucket: Bucket,  # noqa: F811
) -> None:
    content = os.urandom(300_000)
    args = (clinic.db, clinic.blobs, clinic.settings)
    coming = uploads.begin(*args, None, clinic.session.id, "c.bin", len(content))
    uploads.add_part(*args, clinic.session.id, coming.id, 0, content)
    sha256 = hashlib.sha256(content).hexdigest()
    bucket.server.stop()
    with pytest.raises(StoreAway):
        uploads.finish(*args, None, clinic.session.id, coming.id, sha256)
    bucket.server.start()
    assert sweep_now(clinic) == 0  # what came is still waited for
    assert uploads.finish(*args, None, clinic.session.id, coming.id, sha256).sha256 == sha256
    assert clinic.blobs.read(clinic.patient.id, sha256) == content
    assert list(clinic.blobs.incoming.iterdir()) == []
