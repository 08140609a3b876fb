"""The mark next to the database follows the audit log and detects an older database."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from sagittal.server import audit
from sagittal.server.storage import fs
from sagittal.server.storage.db import Database
from sagittal.server.storage.high_water import (
    HighWater,
    MarkKeeper,
    explain_lost_rows,
    raise_mark,
    read_mark,
    read_newest,
    set_mark,
)
from sagittal.server.storage.migrate import copy_database, upgrade
from tests.faults.clinic import until
from tests.faults.model_disk import ModelDisk
from tests.helpers.databases import write_database


def write_rows(db: Database, number: int, action: str = "patient.opened") -> None:
    for _ in range(number):
        with db.write() as c:
            audit.record(c, None, action, "patient", "1" * 32)


def complaint(db: Database, mark: Path) -> str | None:
    with db.read() as c:
        return explain_lost_rows(c, mark)


@pytest.fixture
def mark(tmp_path: Path) -> Path:
    return tmp_path / "audit.mark"


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Database]:
    write_database(tmp_path / "sagittal.db")
    with closing(Database(tmp_path / "sagittal.db")) as opened:
        yield opened


def test_a_database_without_rows_or_without_a_mark_is_trusted(db: Database, mark: Path) -> None:
    assert complaint(db, mark) is None
    assert raise_mark(db, mark)
    assert read_mark(mark) is None
    write_rows(db, 3)
    assert complaint(db, mark) is None


def test_the_mark_follows_the_log(db: Database, mark: Path) -> None:
    write_rows(db, 3)
    assert raise_mark(db, mark)
    with db.read() as c:
        last = read_newest(c)
    assert read_mark(mark) == last
    assert last is not None
    assert last.seq == 3
    write_rows(db, 2)
    assert complaint(db, mark) is None
    raise_mark(db, mark)
    assert read_mark(mark) != last
    assert complaint(db, mark) is None


def test_an_older_database_is_known_also_after_it_has_grown_past_the_mark(
    db: Database, mark: Path, tmp_path: Path
) -> None:
    write_rows(db, 2)
    copy_database(db.source, tmp_path / "older.db")
    write_rows(db, 3)
    raise_mark(db, mark)
    with closing(Database(tmp_path / "older.db")) as older:
        assert "ends at row 2, but had reached row 5" in str(complaint(older, mark))
        write_rows(older, 9, "patient.changed")
        assert "another database" in str(complaint(older, mark))
        assert not raise_mark(older, mark)
        assert complaint(db, mark) is None  # the mark still speaks for the lost one
        set_mark(older, mark)
        assert complaint(older, mark) is None
        assert "another database" in str(complaint(db, mark)) or "ends at row" in str(complaint(db, mark))


@pytest.mark.slow
def test_an_emptied_database_and_a_cut_end_are_known(db: Database, mark: Path, tmp_path: Path) -> None:
    write_rows(db, 4)
    raise_mark(db, mark)
    upgrade(tmp_path / "new.db")
    with closing(Database(tmp_path / "new.db")) as fresh:
        assert "ends at row 0" in str(complaint(fresh, mark))
    with db.write() as c:
        c.exec_driver_sql("DROP TRIGGER audit_no_delete")
        c.exec_driver_sql("DELETE FROM audit WHERE seq = 4")
    assert "ends at row 3" in str(complaint(db, mark))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"nonsense",
        b"[]",
        b"{}",
        b'{"seq": "4", "hash": ""}',
        b'{"seq": true, "hash": "%s"}' % (b"0" * 64),
        b'{"seq": 0, "hash": "%s"}' % (b"0" * 64),
        b"\xff\xfe",
        b"[" * 100_000,
    ],
    ids=["empty", "words", "list", "object", "text", "true", "zero", "bytes", "deep"],
)
def test_a_damaged_mark_is_said_and_not_overwritten(db: Database, mark: Path, content: bytes) -> None:
    write_rows(db, 4)
    mark.write_bytes(content)
    assert "cannot be read" in str(complaint(db, mark))
    assert not raise_mark(db, mark)
    assert mark.read_bytes() == content
    set_mark(db, mark)
    assert complaint(db, mark) is None


@pytest.mark.slow
def test_the_marks_of_two_data_folders_do_not_speak_for_each_other(tmp_path: Path) -> None:
    for name in ("one", "two"):
        upgrade(tmp_path / name / "sagittal.db")
        with closing(Database(tmp_path / name / "sagittal.db")) as db:
            write_rows(db, 3)
            assert raise_mark(db, tmp_path / name / "audit.mark")
    shutil.copy(tmp_path / "one" / "sagittal.db", tmp_path / "two" / "sagittal.db")
    with closing(Database(tmp_path / "two" / "sagittal.db")) as db:
        assert "another database" in str(complaint(db, tmp_path / "two" / "audit.mark"))


def test_the_keeper_raises_the_mark_and_leaves_the_last_row_in_it(db: Database, mark: Path) -> None:
    keeper = MarkKeeper(db, mark, interval_s=0.01)
    keeper.start()
    write_rows(db, 2)
    until(lambda: read_mark(mark))
    write_rows(db, 2)
    keeper.stop()
    with db.read() as c:
        assert read_mark(mark) == read_newest(c)


def test_a_disk_that_refuses_the_mark_stops_nothing_and_it_follows_later(
    db: Database, mark: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(fs.System):
        refused = 0

        def write(self, fd: int, data: bytes | memoryview) -> int:
            self.refused += 1
            raise OSError(28, "No space left on device")

    full = Full()
    monkeypatch.setattr(fs, "system", full)
    keeper = MarkKeeper(db, mark, interval_s=0.01)
    keeper.start()
    write_rows(db, 1)
    until(lambda: full.refused)
    monkeypatch.setattr(fs, "system", fs.System())
    until(lambda: read_mark(mark))
    keeper.stop()


def test_a_power_cut_leaves_the_old_mark_or_the_new_one(
    tmp_path: Path, db: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "audit.mark"
    write_rows(db, 1)
    raise_mark(db, path)
    initial_content = path.read_bytes()
    write_rows(db, 1)
    disk = ModelDisk()
    disk.put(path, initial_content)
    monkeypatch.setattr(fs, "system", disk)
    raise_mark(db, path)
    observations = {state[path] for states in disk.history for state in states}
    assert len(observations) == 2
    assert initial_content in observations
    assert {state[path] for state in disk.history[-1]} == observations - {initial_content}


def test_the_mark_is_a_number_and_a_hash(db: Database, mark: Path) -> None:
    assert read_mark(mark) is None
    mark.write_text('{"seq": 7, "hash": "' + "a" * 64 + '"}\n')
    assert read_mark(mark) == HighWater(7, "a" * 64)
