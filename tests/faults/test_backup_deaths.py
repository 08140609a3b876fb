"""Killed, or without power or room, in the midst of a backup or a restore: whole or not at all."""

from __future__ import annotations

import errno
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import insert

from sagittal.server.safekeeping import checks
from sagittal.server.safekeeping.backups import BackupError, list_backups, make_backup
from sagittal.server.safekeeping.custody import StrangersError, refuse_strangers
from sagittal.server.safekeeping.restore_room import RestoreError
from sagittal.server.safekeeping.restoring import restore, try_restore
from sagittal.server.settings import Settings
from sagittal.server.storage import fs
from sagittal.server.storage.archive import make_key, read_key
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.files.blobs import Blob
from sagittal.server.storage.migrate import exists
from sagittal.server.storage.schema.tables import now, recording_file
from sagittal.server.uploads import recordings
from tests.data import ROOT
from tests.faults.clinic import Clinic, find_room
from tests.faults.failing import Dying, FailingSystem, PowerError
from tests.helpers.engines import on_both_engines

BESIDE = {"erased.json"}
STEP = {"sqlite": 1, "postgresql": 13}
"""It dies at every so many of the calls: a copy of a server's database is migrated, in a second."""


@pytest.fixture
def clinic(tmp_path: Path) -> Iterator[Clinic]:
    (tmp_path / "disk").mkdir()
    new_clinic = Clinic(tmp_path / "home", lease_s=1.5)
    yield new_clinic
    new_clinic.db.close()


def refer(clinic: Clinic, blob: Blob) -> None:
    """A row of the recording that needs this file."""
    with clinic.db.write() as c:
        this = recordings.require_current(c, clinic.session.id)
        c.execute(
            insert(recording_file).values(
                recording_id=this.id, name="big.bin", size=blob.size, sha256=blob.sha256, added_at=now()
            )
        )


def is_whole(home: Settings) -> bool:
    with closing(Database(home.database_source)) as db:
        return not checks.check(db, FolderBlobs(home.blobs), home)


@pytest.mark.death
@on_both_engines
def test_a_backup_that_dies_anywhere_leaves_no_file_that_looks_like_one(
    clinic: Clinic, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = clinic.folder.parent / "disk"
    for deaths in range(0, 200, STEP[engine]):
        target = disk / f"{deaths}.tar"
        monkeypatch.setattr(fs, "system", Dying(deaths))
        died = False
        try:
            make_backup(clinic.db, clinic.settings, target, None)
        except PowerError:
            died = True
        monkeypatch.setattr(fs, "system", fs.System())
        if target.exists():
            assert try_restore(target, clinic.settings, None).patients == 1
        else:
            assert died
        if not died:
            break
    assert deaths > 15
    assert not list(clinic.settings.backups.glob("*.tmp*"))
    for path in disk.glob("*.tmp"):
        os.utime(path, (0, 0))
    make_backup(clinic.db, clinic.settings, disk / "last.tar", None)
    assert not list(disk.glob("*.tmp"))


@on_both_engines
def test_a_restore_that_dies_anywhere_is_made_again(
    clinic: Clinic, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    clinic.settings.live.mkdir()
    (clinic.settings.live / f"{'a' * 32}.log").write_bytes(b"SAGLIVE1\n")
    result = make_backup(clinic.db, clinic.settings, clinic.folder.parent / "disk", None)
    for deaths in range(0, 400, STEP[engine]):
        home = find_room(clinic, f"again{deaths}")
        monkeypatch.setattr(fs, "system", Dying(deaths))
        died = False
        try:
            restore(result.path, home, None)
        except PowerError:
            died = True
        monkeypatch.setattr(fs, "system", fs.System())
        if not died:
            break
        if not exists(home.database_source):
            if home.restoring.exists():
                with pytest.raises(StrangersError, match="was interrupted"):
                    refuse_strangers(home)
            restore(result.path, home, None)
        assert exists(home.database_source)
        refuse_strangers(home)
        if deaths % 10 == 0:
            assert [p.read_bytes() for p in home.blobs.glob("*/*")] == [b"signals"]
    assert deaths > 40


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_a_disk_that_refuses_is_told_and_nothing_is_left(
    clinic: Clinic, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = clinic.folder.parent / "disk"
    make_key(clinic.folder.parent / "key")
    for key in (None, read_key(clinic.folder.parent / "key")):
        for fail_at in range(6, 12):
            monkeypatch.setattr(fs, "system", FailingSystem(fail_at, number))
            with pytest.raises(BackupError, match=os.strerror(number)):
                make_backup(clinic.db, clinic.settings, disk, key)
            monkeypatch.setattr(fs, "system", fs.System())
            assert {p.name for p in disk.iterdir()} <= BESIDE
    result = make_backup(clinic.db, clinic.settings, disk, None)
    home = find_room(clinic, "again")
    for fail_at in range(5, 40, 5):
        monkeypatch.setattr(fs, "system", FailingSystem(fail_at, number))
        with pytest.raises(RestoreError, match="nothing was put in place"):
            restore(result.path, home, None)
        monkeypatch.setattr(fs, "system", fs.System())
        assert {p.name for p in home.data_dir.iterdir()} <= {"server.lock"}


def run(*words: str, url: str = "") -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "sagittal.server.main", *words], cwd=ROOT, stdout=subprocess.DEVNULL,
        env=os.environ | {"SAGITTAL_DATABASE_URL": url},
    )  # fmt: skip


@on_both_engines
def test_killed_in_the_midst(clinic: Clinic) -> None:
    disk, seed = clinic.folder.parent / "disk", random.Random(19)  # noqa: S311
    space = clinic.patient.id
    with clinic.blobs.receive(space) as receiver:
        for _ in range(30):
            receiver.write(seed.randbytes(1 << 20))
        big = receiver.keep()
    refer(clinic, big)
    data, url = ["--data", str(clinic.folder)], clinic.settings.database_url

    def kill(process: subprocess.Popen[bytes], reached: Callable[[], bool]) -> None:
        while not reached() and process.poll() is None:
            time.sleep(0.002)
        time.sleep(seed.uniform(0.0, 0.05))
        process.send_signal(signal.SIGKILL)
        process.wait()

    for _ in range(3):
        backup = run("backup", str(disk), *data, url=url)
        kill(backup, lambda: any(p.stat().st_size > 0 for p in disk.glob("*.tmp")))
        for one in list_backups(disk):
            assert try_restore(one.path, clinic.settings, None).patients == 1
            one.path.unlink()
    result = make_backup(clinic.db, clinic.settings, disk, None)
    home = find_room(clinic, "again")
    data = ["--data", str(home.data_dir)]
    for _ in range(3):
        kill(
            run("restore", str(result.path), *data, url=home.database_url),
            lambda at=home.restoring: any(at.rglob("*.tmp")),  # type: ignore[misc]
        )
        if exists(home.database_source):
            assert is_whole(home)
            fs.remove_tree(home.data_dir)
            home = find_room(clinic, "again")
    assert run("restore", str(result.path), *data, url=home.database_url).wait() == 0
    assert is_whole(home)


def test_memory_does_not_grow_with_what_is_backed_up(clinic: Clinic) -> None:
    make_key(clinic.folder.parent / "key")
    key = ["--key", str(clinic.folder.parent / "key")]

    def peak(settings: Settings, *words: str) -> int:
        process = run(*words, "--data", str(settings.data_dir), *key, url=settings.database_url)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = status
        assert status == 0
        return used.ru_maxrss

    def both(name: str) -> list[int]:
        target = str(clinic.folder.parent / "disk" / name)
        return [
            peak(clinic.settings, "backup", target),
            peak(find_room(clinic, f"{name}-again"), "restore", target),
        ]

    small = both("small.tar.age")
    with clinic.blobs.receive(clinic.patient.id) as receiver:
        for _ in range(120):
            receiver.write(os.urandom(1 << 20))
        big = receiver.keep()
    refer(clinic, big)
    for initial, final in zip(small, both("big.tar.age"), strict=True):
        assert final - initial < 40_000  # kB; the file has 120 000
