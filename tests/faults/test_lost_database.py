"""A database that is missing, emptied, older or another one never costs a recording."""

from __future__ import annotations

import datetime as dt
import os
import shutil
import subprocess
import sys
import threading
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from sagittal.server import audit
from sagittal.server.clinic import sessions
from sagittal.server.main import main
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import checks, custody, erasure
from sagittal.server.safekeeping.sweep import sweep
from sagittal.server.settings import Settings
from sagittal.server.storage import fs
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.trash import KEPT, FolderTrash
from sagittal.server.storage.high_water import raise_mark
from sagittal.server.storage.migrate import copy_database, exists, upgrade
from sagittal.server.uploads import receiving, recordings
from sagittal.server.worker.task import load
from sagittal.server.worker.worker import Worker
from tests.data import ROOT
from tests.faults.clinic import Clinic
from tests.faults.failing import Dying, PowerError
from tests.faults.model_disk import ModelDisk
from tests.helpers.engines import choose_url, on_both_engines, tell_commands
from tests.helpers.marks import sqlite_only
from tests.helpers.postgres import make_lasting_database
from tests.helpers.service import line_with

CONTENTS = {b"signals", b"walk two", b"walk three"}
STEP = {"sqlite": 1, "postgresql": 4}
"""Once its rows are gone an erasure dies at every so many of its calls; before that at every one."""


def upload(clinic: Clinic, name: str, content: bytes) -> None:
    with receiving.receive(
        clinic.db, clinic.blobs, clinic.settings, None, clinic.session.id, name
    ) as incoming:
        incoming.write(content)
        incoming.keep()


def at_once(clinic: Clinic) -> Settings:
    """A sweep that does not wait for files to grow old."""
    return replace(clinic.settings, sweep_grace_s=0.0)


def stored(clinic: Clinic) -> set[bytes]:
    return {clinic.blobs.find_path(f).read_bytes() for f in clinic.blobs.files()}


def discarded(clinic: Clinic) -> list[bytes]:
    trash = FolderTrash(clinic.settings.trash, clinic.settings.blobs)
    return sorted(trash.path(one).read_bytes() for one in trash.files())


def backup(clinic: Clinic) -> Path:
    """What an administrator keeps."""
    target = clinic.folder / "backup.db"
    copy_database(clinic.db.source, target)
    return target


def lose(clinic: Clinic) -> None:
    """Stop, and lose the database: the file is gone, PostgreSQL has another one without tables."""
    clinic.db.close()
    if clinic.settings.database_url:
        url = make_lasting_database(migrated=False)
        clinic.settings = replace(clinic.settings, database_url=url)
    for path in clinic.folder.glob("sagittal.db*"):
        path.unlink()


def put(clinic: Clinic, database: Path | None) -> None:
    """Stop, and start with this database in the place of the one that was there; None = a new one."""
    lose(clinic)
    if database is not None:
        copy_database(database, clinic.settings.database_source)
    upgrade(clinic.settings.database_source)
    clinic.db = Database(clinic.settings.database_source)


def command(clinic: Clinic, *words: str) -> int:
    with pytest.MonkeyPatch.context() as environment:
        tell_commands(environment, clinic.settings)
        return main([*words, "--data", str(clinic.folder)])


def findings(clinic: Clinic) -> list[str]:
    return [f"{f.area}: {f.message}" for f in checks.check(clinic.db, clinic.blobs, clinic.settings)]


@pytest.fixture
def full(clinic: Clinic) -> Clinic:
    """Three recordings, a mark, and the backup of last week, when there was one."""
    backup(clinic)
    upload(clinic, "b.txt", b"walk two")
    upload(clinic, "c.txt", b"walk three")
    raise_mark(clinic.db, clinic.settings.mark)
    return clinic


def serve(settings: Settings) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [
            sys.executable, "-m", "sagittal.server.main",
            "serve", "--data", str(settings.data_dir), "--port", "0",
        ],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "SAGITTAL_SWEEP_GRACE_S": "0", "SAGITTAL_WORKERS": "0",
             "SAGITTAL_DATABASE_URL": settings.database_url},
    )  # fmt: skip


@pytest.mark.death
@pytest.mark.parametrize("database", ["missing", pytest.param("empty file", marks=sqlite_only), "emptied"])
def test_a_start_is_refused_when_files_are_there_and_the_database_knows_no_patient(
    full: Clinic, database: str
) -> None:
    lose(full)
    if database == "empty file":
        full.settings.database.touch()
    elif database == "emptied":
        upgrade(full.settings.database_source)
    process = serve(full.settings)
    _, message = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "knows no patient" in message
    assert "3 stored files and 0 live logs" in message
    assert "sagittal accept" in message
    assert "Traceback" not in message
    assert exists(full.settings.database_source) is (database != "missing")
    assert stored(full) == CONTENTS


def test_a_start_is_refused_for_a_live_log_alone_and_not_for_an_empty_folder(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path)
    custody.refuse_strangers(settings)
    settings.live.mkdir()
    custody.refuse_strangers(settings)
    (settings.live / f"{'a' * 32}.log").write_bytes(b"SAGLIVE1\n")
    with pytest.raises(custody.StrangersError, match="0 stored files and 1 live logs"):
        custody.refuse_strangers(settings)


def test_the_first_start_on_an_empty_folder_works(tmp_path: Path) -> None:
    process = serve(Settings(data_dir=tmp_path / "new", database_url=choose_url(tmp_path / "new")))
    try:
        assert line_with(process, r"http://\S+/set-up/\S+")
    finally:
        process.terminate()
        process.communicate()


def test_half_received_files_and_what_is_not_ours_are_no_recordings(tmp_path: Path) -> None:
    for name in ("incoming/x.tmp", "lost+found/y", "notes.txt"):
        path = tmp_path / "blobs" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"z")
    custody.refuse_strangers(Settings(data_dir=tmp_path))
    assert (tmp_path / "blobs" / "incoming" / "x.tmp").read_bytes() == b"z"


def test_nothing_is_swept_with_an_emptied_database(full: Clinic) -> None:
    full.settings.mark.unlink()
    put(full, None)
    assert sweep(full.db, full.blobs, at_once(full)) == 0
    assert stored(full) == CONTENTS


@on_both_engines
def test_nothing_is_swept_after_the_database_went_back_in_time(
    full: Clinic, caplog: pytest.LogCaptureFixture
) -> None:
    put(full, full.folder / "backup.db")
    custody.refuse_strangers(full.settings)  # it knows a patient: the clinic can work
    assert sweep(full.db, full.blobs, at_once(full)) == 0
    assert "no stored file is taken away" in caplog.text
    with full.db.write() as c:
        for _ in range(20):  # and grows past the number that was reached before
            audit.record(c, None, "patient.opened", "patient", full.patient.id)
    assert not raise_mark(full.db, full.settings.mark)
    assert sweep(full.db, full.blobs, at_once(full)) == 0
    assert stored(full) == CONTENTS


def test_the_way_back_after_the_wrong_backup_was_accepted(
    full: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    newest = full.folder / "newest.db"
    copy_database(full.db.source, newest)
    put(full, full.folder / "backup.db")
    assert command(full, "accept") == 0
    assert "had reached row" in capsys.readouterr().out
    assert sweep(full.db, full.blobs, at_once(full)) == 2
    assert stored(full) == {b"signals"}
    assert discarded(full) == [b"walk three", b"walk two"]
    assert command(full, "trash") == 0
    assert "2 files in" in capsys.readouterr().out
    put(full, newest)
    assert sweep(full.db, full.blobs, at_once(full)) == 0  # another database than the accepted one
    result = findings(full)
    assert len([text for text in result if "sagittal trash --restore" in text]) == 2
    assert any("another database" in text and "sagittal accept" in text for text in result)
    assert command(full, "accept") == 0
    assert command(full, "trash", "--restore") == 0
    assert "2 files that the database refers to are back" in capsys.readouterr().out
    assert stored(full) == CONTENTS
    assert discarded(full) == []
    assert findings(full) == []
    assert sweep(full.db, full.blobs, at_once(full)) == 0


def test_an_accepted_new_beginning_starts_and_keeps_the_old_files_for_thirty_days(
    full: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    lose(full)
    assert command(full, "accept") == 0
    full.db = Database(full.settings.database_source)
    process = serve(full.settings)
    try:
        assert line_with(process, r"http://\S+/set-up/\S+")
    finally:
        process.terminate()
        process.communicate()
    assert sweep(full.db, full.blobs, at_once(full)) == 3
    assert set(discarded(full)) == CONTENTS
    trash = FolderTrash(full.settings.trash, full.settings.blobs)
    text = (full.settings.trash / "list.txt").read_text()
    assert all(one.way in text for one in trash.files())
    assert text.count("\n") == 4
    since = next(trash.files()).since
    assert trash.expire(since + KEPT - dt.timedelta(seconds=1)) == 0
    assert trash.expire(since + KEPT) == 3
    assert [p.name for p in full.settings.trash.iterdir()] == ["list.txt"]
    assert dt.timedelta(days=30) == KEPT


def test_the_mark_of_one_folder_does_not_trust_the_database_of_another(full: Clinic, tmp_path: Path) -> None:
    second = tmp_path / "other.db"
    copy_database(full.db.source, second)
    with closing(Database(second)) as db, db.write() as c:
        sessions.create(c, None, full.patient.id)
    assert sweep(full.db, full.blobs, at_once(full)) == 0
    put(full, second)  # a continuation of ours: trusted
    with full.db.read() as c:
        assert custody.find_doubt(c, full.settings) is None
    raise_mark(full.db, full.settings.mark)
    put(full, full.folder / "backup.db")
    with full.db.read() as c:
        assert custody.find_doubt(c, full.settings) is not None


def test_a_damaged_mark_stops_the_sweep_and_accept_writes_it_anew(full: Clinic) -> None:
    full.blobs.put(full.patient.id, b"of nobody")
    full.settings.mark.write_bytes(b"\x00" * 40)
    assert sweep(full.db, full.blobs, at_once(full)) == 0
    assert command(full, "accept") == 0
    assert sweep(full.db, full.blobs, at_once(full)) == 1
    assert discarded(full) == [b"of nobody"]


# the trash


def test_a_crash_anywhere_in_a_move_to_the_trash_leaves_the_file_here_or_there(
    full: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    deaths = 0
    while True:
        full.blobs.put(full.patient.id, b"of nobody")
        monkeypatch.setattr(fs, "system", Dying(deaths))
        try:
            sweep(full.db, full.blobs, at_once(full))
        except PowerError:
            died = True
        else:
            died = False
        monkeypatch.setattr(fs, "system", fs.System())
        places = [b"of nobody" in stored(full), b"of nobody" in discarded(full)]
        assert any(places)
        assert stored(full) >= CONTENTS
        sweep(full.db, full.blobs, at_once(full))
        assert stored(full) == CONTENTS
        assert findings(full) == []
        shutil.rmtree(full.settings.trash)
        if not died:
            break
        deaths += 1
    assert deaths >= 8


def test_a_power_cut_in_a_move_to_the_trash_leaves_the_whole_file_here_or_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    space, name, timestamp = "a" * 32, "b" * 64, dt.datetime(2026, 3, 14, tzinfo=dt.UTC)
    source = tmp_path / "blobs" / space / name
    trash = FolderTrash(tmp_path / "trash", tmp_path / "blobs")
    target = trash.root / "20260314T000000Z" / space / name
    disk = ModelDisk()
    disk.put(source, b"walk")
    fs.make_folder(target.parent)
    monkeypatch.setattr(fs, "system", disk)
    trash.take([(space, name)], timestamp)
    monkeypatch.setattr(trash, "write_list", lambda: None)
    trash.settle([(space, name)], timestamp)
    for states in disk.history:
        for state in states:
            assert [state.get(source), state.get(target)].count(b"walk") == 1
    assert all(set(state) == {target} for state in disk.history[-1])


def test_a_trash_on_another_file_system_takes_nothing_and_loses_nothing(
    full: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Elsewhere(fs.System):
        def replace(self, source: Path, target: Path) -> None:
            if full.settings.trash in target.parents and target.name != "list.txt":
                raise OSError(18, "Invalid cross-device link")
            super().replace(source, target)

    full.blobs.put(full.patient.id, b"of nobody")
    monkeypatch.setattr(fs, "system", Elsewhere())
    with pytest.raises(OSError, match="cross-device"):
        sweep(full.db, full.blobs, at_once(full))
    assert b"of nobody" in stored(full)


def test_a_file_in_the_trash_that_changed_is_found_by_the_check(full: Clinic) -> None:
    full.blobs.put(full.patient.id, b"of nobody")
    sweep(full.db, full.blobs, at_once(full))
    assert findings(full) == []
    trash = FolderTrash(full.settings.trash, full.settings.blobs)
    trash.path(next(trash.files())).write_bytes(b"of somebodi")
    [result] = findings(full)
    assert result.startswith("trash: ")
    assert "has changed on the disk" in result


# erasure is meant: nothing waits in the trash


def traces(clinic: Clinic) -> set[str]:
    """Files in the data folder that hold bytes of the erased recordings."""
    return {
        str(path.relative_to(clinic.folder))
        for path in clinic.folder.rglob("*")
        if path.is_file()
        and path.suffix not in {".db", ".db-wal", ".db-shm"}
        and b"walk" in path.read_bytes()
    }


def take_out(clinic: Clinic, name: str) -> None:
    with clinic.db.write() as c:
        recordings.remove_file(c, None, clinic.session.id, name)


def erase(clinic: Clinic, label: str) -> None:
    if label == "patient":
        erasure.erase_patient(
            clinic.db, ReviewedAnalyses(clinic.blobs), clinic.settings, None, clinic.patient.id, confirm="P-1"
        )
    else:
        erasure.erase_session(
            clinic.db, ReviewedAnalyses(clinic.blobs), clinic.settings, None, clinic.session.id
        )


@on_both_engines
@pytest.mark.parametrize("what", ["patient", "session"])
def test_an_erasure_takes_what_lies_in_the_trash_with_it(full: Clinic, what: str) -> None:
    take_out(full, "b.txt")
    assert sweep(full.db, full.blobs, at_once(full)) == 1
    assert discarded(full) == [b"walk two"]
    erase(full, what)
    assert traces(full) == set()
    assert sweep(full.db, full.blobs, at_once(full)) == 0
    assert discarded(full) == []


@on_both_engines
@pytest.mark.parametrize("what", ["patient", "session"])
def test_an_interrupted_erasure_is_finished_by_the_next_start(
    tmp_path: Path, what: str, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    deaths, over = 0, False
    while not over:
        clinic = Clinic(tmp_path / str(deaths), lease_s=1.5)
        upload(clinic, "b.txt", b"walk two")
        take_out(clinic, "b.txt")
        upload(clinic, "c.txt", b"walk three")
        sweep(clinic.db, clinic.blobs, at_once(clinic))
        monkeypatch.setattr(fs, "system", Dying(deaths))
        try:
            erase(clinic, what)
            over = True
        except PowerError:
            pass
        monkeypatch.setattr(fs, "system", fs.System())
        with clinic.db.read() as c:
            committed = any("erased" in row.action for row in audit.list_entries(c))
        custody.refuse_strangers(clinic.settings)  # also when the only patient was half erased
        erasure.finish(clinic.db, clinic.blobs, clinic.settings)
        assert (traces(clinic) == set()) is committed
        assert list(clinic.settings.erasing.glob("*.json")) == []
        assert findings(clinic) == []
        assert committed or (stored(clinic) == {b"signals", b"walk three"})
        clinic.db.close()
        deaths += STEP[engine] if committed else 1
    assert deaths >= 8


@on_both_engines
def test_a_result_that_comes_after_its_session_was_erased_is_gone_at_once(clinic: Clinic) -> None:
    load(clinic.settings.task_modules)
    clinic.submit()
    claim = clinic.queue.claim("w", ("tiny",))
    assert claim is not None
    worker = Worker(clinic.settings, clinic.db, clinic.blobs, clinic.queue, threading.Event())
    erase(clinic, "session")
    worker._publish(claim, {"result.txt": b"walk"})
    assert stored(clinic) == set()


@on_both_engines
def test_a_late_file_of_an_erased_patient_does_not_wait_in_the_trash(full: Clinic) -> None:
    erase(full, "patient")
    full.blobs.put(full.patient.id, b"walk four")
    custody.refuse_strangers(full.settings)
    assert sweep(full.db, full.blobs, at_once(full)) == 1
    assert traces(full) == set()


def test_a_note_that_is_no_note_erases_nothing(full: Clinic) -> None:
    full.settings.erasing.mkdir()
    for i, text in enumerate(["", "[]", '{"spaces": [".."], "files": [], "takes": []}', '{"takes": ["*"]}']):
        (full.settings.erasing / f"{i}.json").write_text(text)
    erasure.finish(full.db, full.blobs, full.settings)
    assert stored(full) == CONTENTS
    assert len(list(full.settings.erasing.iterdir())) == 4
