"""What goes wrong around a bucket: mistyped, away at a start, half restored, moved to under a worker."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Collection, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy.exc import OperationalError

from sagittal.server.main import main
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import backups, checks, custody, erasure, restoring, sweep
from sagittal.server.safekeeping.restore_room import RestoreError
from sagittal.server.safekeeping.restoring import restore
from sagittal.server.settings import Settings, SettingsError
from sagittal.server.storage import fs, references
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_bucket import BucketBlobs, BucketTrash
from sagittal.server.storage.files.blob_opening import note_bucket, open_blobs, read_note
from sagittal.server.storage.files.blobs import StoreAway
from sagittal.server.storage.files.trash import Address, name_stamp
from sagittal.server.uploads import uploads
from tests.data import ROOT
from tests.faults.clinic import Clinic, until
from tests.faults.failing import Dying, PowerError
from tests.helpers.buckets import Bucket, bucket, s3_server  # noqa: F401 - fixtures
from tests.helpers.databases import write_database
from tests.helpers.service import line_with


@pytest.fixture
def clinic(tmp_path: Path, bucket: Bucket) -> Iterator[Clinic]:  # noqa: F811
    new_clinic = Clinic(tmp_path / "home", lease_s=5.0, database_url="", bucket=bucket.url)
    yield new_clinic
    new_clinic.db.close()


@pytest.fixture
def archive(clinic: Clinic, tmp_path: Path) -> Path:
    (tmp_path / "disk").mkdir()
    return backups.make_backup(clinic.db, clinic.settings, tmp_path / "disk", None).path


def erase(clinic: Clinic) -> None:
    erasure.erase_patient(
        clinic.db, ReviewedAnalyses(clinic.blobs), clinic.settings, None, clinic.patient.id, confirm="P-1"
    )


def sweep_now(clinic: Clinic) -> int:
    return sweep.sweep(clinic.db, clinic.blobs, replace(clinic.settings, sweep_grace_s=0.0))


def start(*words: str, home: Path, url: str, **more: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "sagittal.server.main", *words, "--data", str(home)],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "SAGITTAL_BUCKET": url, **more},
    )  # fmt: skip


def refused(*words: str, home: Path, url: str, **more: str) -> str:
    """Message of a command that exits with 1."""
    with start(*words, home=home, url=url, **more) as process:
        _, message = process.communicate(timeout=120)
    assert process.returncode == 1, message
    return message


def is_whole(home: Settings) -> bool:
    with closing(Database(home.database)) as db:
        return not checks.check(db, open_blobs(home), home) and not home.restoring.exists()


@pytest.mark.sweep
def test_a_move_waits_for_the_last_worker(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    clinic = Clinic(tmp_path / "home", lease_s=5.0, database_url="")
    with start("worker", home=clinic.folder, url="") as worker:
        try:
            until(lambda: clinic.settings.workers_lock.exists() and clinic.settings.workers_lock.read_text())
            for command, name, value in (
                ("move-blobs", "SAGITTAL_BUCKET", bucket.url),
                ("move-database", "SAGITTAL_DATABASE_URL", "postgresql://127.0.0.1:1/nobody"),
            ):
                with monkeypatch.context() as changed:
                    changed.setenv(name, value)
                    assert main([command, "--data", str(clinic.folder)]) == 1
                assert f"is in use by worker process {worker.pid} on" in capsys.readouterr().err
        finally:
            worker.terminate()
            worker.communicate(timeout=60)
    assert len(list(clinic.blobs.files())) == 1
    monkeypatch.setenv("SAGITTAL_BUCKET", bucket.url)
    assert main(["move-blobs", "--data", str(clinic.folder)]) == 0
    monkeypatch.delenv("SAGITTAL_BUCKET")
    held = fs.Lock(clinic.settings.workers_lock, "a move")
    assert "is in use by a move" in refused("worker", home=clinic.folder, url=bucket.url)
    held.release()
    clinic.db.close()


@pytest.mark.sweep
def test_a_mistyped_bucket_binds_nobody(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    home = Settings(data_dir=tmp_path / "home")
    assert "cannot be used" in refused("serve", "--port", "0", home=home.data_dir, url="s3://tpyo")
    monkeypatch.setenv("SAGITTAL_BUCKET", "s3://tpyo")
    assert main(["trash", "--data", str(home.data_dir)]) == 1
    assert read_note(home) == ""
    with start("serve", "--port", "0", home=home.data_dir, url=bucket.url) as server:
        try:
            line_with(server, r"http://\S+/set-up/\S+")
            assert read_note(home) == bucket.url
        finally:
            server.terminate()
            server.communicate(timeout=60)
    with pytest.raises(SettingsError, match=f"Set SAGITTAL_BUCKET={bucket.url}"):
        note_bucket(replace(home, bucket="s3://tpyo"))


@pytest.mark.sweep
def test_an_empty_clinic_starts_while_its_bucket_is_away_and_is_bound_by_its_first_file(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
) -> None:
    home = Settings(data_dir=tmp_path / "home", bucket=bucket.url)
    write_database(home.database)
    bucket.server.stop()
    with start("serve", "--port", "0", home=home.data_dir, url=home.bucket) as server:
        try:
            line_with(server, r"http://\S+/set-up/\S+")
        finally:
            server.terminate()
            server.communicate(timeout=60)
    with closing(Database(home.database)) as db:
        custody.refuse_strangers(home)
        with db.read() as c:
            assert "does not say now" in str(custody.find_doubt(c, home))
        with pytest.raises(StoreAway):
            custody.accept(db, home)
        bucket.server.start()
        with db.read() as c:
            assert custody.find_doubt(c, home) is None
    assert read_note(home) == ""
    open_blobs(home).put("a" * 32, b"walk")
    assert read_note(home) == bucket.url
    with pytest.raises(custody.StrangersError, match="1 stored files"):
        custody.refuse_strangers(home)


def half_fill(archive: Path, home: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    """A restore whose power goes while it fills the bucket."""
    adopt = BucketBlobs.adopt

    def adopt_and_die(self: BucketBlobs, space: str, path: Path, sha256: str) -> None:
        adopt(self, space, path, sha256)
        raise PowerError

    with monkeypatch.context() as changed:
        changed.setattr(BucketBlobs, "adopt", adopt_and_die)
        with pytest.raises(PowerError):
            restore(archive, home, None)


@pytest.mark.sweep
def test_a_restore_into_a_bucket_may_fail_again_and_again(
    clinic: Clinic, archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = replace(clinic.settings, data_dir=tmp_path / "again", bucket=clinic.settings.bucket + "-again")
    half_fill(archive, home, monkeypatch)

    def fail(*_: object) -> Any:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as changed:
        changed.setattr(restoring, "_extract", fail)
        for _ in range(2):
            with pytest.raises(RestoreError, match="could not be written"):
                restore(archive, home, None)
    with monkeypatch.context() as changed:
        changed.setattr(restoring, "require_room", fail)
        with pytest.raises(RestoreError, match="could not be written"):
            restore(archive, home, None)
    with pytest.raises(custody.StrangersError, match="was interrupted"):
        custody.refuse_strangers(home)
    another = replace(home, bucket=clinic.settings.bucket)
    with pytest.raises(RestoreError, match="is not empty"):
        restore(archive, another, None)
    assert restore(archive, home, None).files == 1
    assert is_whole(home)


@pytest.mark.sweep
def test_a_restore_into_a_bucket_that_dies_twice_anywhere_is_made_again(
    clinic: Clinic, archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    died = 0
    for deaths in range(0, 200, 3):
        home = replace(
            clinic.settings, data_dir=tmp_path / f"{deaths}", bucket=f"{clinic.settings.bucket}-{deaths}"
        )
        half_fill(archive, home, monkeypatch)
        with monkeypatch.context() as changed:
            changed.setattr(fs, "system", Dying(deaths))
            try:
                restore(archive, home, None)
            except PowerError:
                died += 1
        if not home.database.exists():
            assert restore(archive, home, None).files == 1
        with closing(Database(home.database)) as db:
            assert checks.check(db, open_blobs(home), home) == []
        if died <= deaths // 3:
            break
    assert died > 10


@pytest.mark.sweep
def test_a_start_that_is_refused_leaves_room_for_the_restore_that_it_asks_for(
    clinic: Clinic, archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = replace(clinic.settings, data_dir=tmp_path / "again", bucket=clinic.settings.bucket + "-again")
    with monkeypatch.context() as changed:
        changed.setattr(fs, "system", Dying(20))
        with pytest.raises(PowerError):
            restore(archive, home, None)
    initial_names = {path.name for path in home.data_dir.iterdir()}
    message = refused("serve", "--port", "0", home=home.data_dir, url=home.bucket)
    assert "Run `sagittal restore` again" in message
    assert {path.name for path in home.data_dir.iterdir()} == initial_names
    assert restore(archive, home, None).files == 1
    assert is_whole(home)


@pytest.mark.sweep
@pytest.mark.parametrize(
    "stranger", ["blobs/incoming/a.part", "blobs/bucket.txt", "nodes/a/live/a.log", "nodes/a/b"]
)
def test_a_restore_passes_over_what_a_start_makes_and_nothing_else(
    clinic: Clinic, archive: Path, tmp_path: Path, stranger: str
) -> None:
    home = replace(clinic.settings, data_dir=tmp_path / "again", bucket="")
    result = ("nodes/a/server.lock", "nodes/key", "nodes/key.lock", "part-locks/aa.lock", "workers.lock")
    for name in (*result, stranger):
        fs.make_folder((home.data_dir / name).parent)
        (home.data_dir / name).write_bytes(b"a")
    fs.make_folder(home.blobs / "incoming")
    with pytest.raises(RestoreError, match="is not empty"):
        restore(archive, home, None)
    (home.data_dir / stranger).unlink()
    fs.remove_tree(home.nodes / "a" / "live")
    assert restore(archive, home, None).files == 1
    assert is_whole(home)


@pytest.mark.slow
def test_an_erasure_asks_the_bucket_while_others_may_write(
    clinic: Clinic,
    bucket: Bucket,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wrote = []

    def write(call: Any) -> Any:
        def asked(*args: Any) -> Any:
            with closing(Database(clinic.settings.database)) as db, db.write():
                wrote.append(call.__qualname__)
            return call(*args)

        return asked

    for kind, name in ((BucketBlobs, "erase"), (BucketTrash, "remove")):
        monkeypatch.setattr(kind, name, write(getattr(kind, name)))
    erase(clinic)
    assert wrote == ["BucketBlobs.erase", "BucketTrash.remove"]
    assert bucket.objects() == set()


@pytest.mark.sweep
def test_an_erasure_whose_database_goes_away_is_finished_later(
    clinic: Clinic,
    bucket: Bucket,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(_: Database) -> Any:
        raise OperationalError("", {}, Exception("terminating connection due to idle-in-transaction timeout"))

    with monkeypatch.context() as changed:
        changed.setattr(Database, "fold", fail)
        erase(clinic)
    [_] = clinic.settings.erasing.iterdir()
    erasure.finish(clinic.db, clinic.blobs, clinic.settings)
    assert list(clinic.settings.erasing.iterdir()) == []
    assert bucket.objects() == set()


def test_who_is_erased_while_a_sweep_copies_leaves_no_copy(
    clinic: Clinic,
    bucket: Bucket,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clinic.blobs.put(clinic.patient.id, b"of nobody")
    prepare = BucketTrash.prepare
    copied: list[str] = []

    def prepare_late(self: BucketTrash, result: Collection[Address], position: Any) -> None:
        """The copies are done after the erasure has looked into the trash."""
        prepare(self, result, position)
        erase(clinic)
        copied.extend(f"trash/{name_stamp(position)}/{space}/{name}" for space, name in result)
        for key in copied:
            bucket.write(key, b"of nobody")

    monkeypatch.setattr(BucketTrash, "prepare", prepare_late)
    sweep_now(clinic)
    assert len(copied) == 1
    assert bucket.objects() == set()
    # a sweep that was killed then could not tidy up; the next one does
    bucket.write(copied[0], b"of nobody")
    sweep_now(clinic)
    assert bucket.objects() == set()


def test_a_copy_of_what_an_erased_session_had_goes_too(
    clinic: Clinic,
    bucket: Bucket,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stray = clinic.blobs.put(clinic.patient.id, b"of nobody")
    retained = bucket.objects() - {f"blobs/{clinic.patient.id}/{stray.sha256}"}
    prepare = BucketTrash.prepare

    def prepare_and_remove(self: BucketTrash, result: Collection[Address], position: Any) -> None:
        prepare(self, result, position)
        assert len(bucket.objects()) == 3
        references.discard(clinic.db, clinic.blobs, clinic.patient.id, [stray.sha256])

    monkeypatch.setattr(BucketTrash, "prepare", prepare_and_remove)
    assert sweep_now(clinic) == 0
    assert bucket.objects() == retained


def test_of_two_sweeps_at_once_one_runs(clinic: Clinic) -> None:
    clinic.blobs.put(clinic.patient.id, b"of nobody")
    with clinic.blobs.lock_sweep():
        assert sweep_now(clinic) == 0
    assert sweep_now(clinic) == 1


def test_what_was_sent_in_parts_stays_until_its_row_is_written(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = b"signals of an hour"
    args = (clinic.db, clinic.blobs, clinic.settings)
    coming = uploads.begin(*args, None, clinic.session.id, "c.bin", len(content))
    uploads.add_part(*args, clinic.session.id, coming.id, 0, content)
    sha256 = hashlib.sha256(content).hexdigest()

    def away(*_: object) -> None:
        raise StoreAway("away", refuses=False)

    with monkeypatch.context() as changed:
        changed.setattr(BucketBlobs, "require", away)
        with pytest.raises(StoreAway):
            uploads.finish(*args, None, clinic.session.id, coming.id, sha256)
    with clinic.db.read() as c:
        assert uploads.get(c, clinic.blobs, clinic.session.id, coming.id).offset == len(content)
    assert uploads.finish(*args, None, clinic.session.id, coming.id, sha256).sha256 == sha256
    assert list(clinic.blobs.incoming.iterdir()) == []
