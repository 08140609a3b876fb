"""Estimator output is written in groups, in order, and kept when the disk refuses writes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import delete, select

from sagittal.server.clinic import patients, sessions
from sagittal.server.live.journal import Journal
from sagittal.server.live_takes import live
from sagittal.server.storage import sqlite_file
from sagittal.server.storage.db import Database
from sagittal.server.storage.disk_log import DiskLog
from sagittal.server.storage.schema.live_tables import live_event, live_take
from tests.helpers.databases import write_database

CUE = {
    "n": 1, "side": "left", "start_s": 1.0, "t_s": 2.0, "value": 60.0, "error_sd": 0.0, "zone": "in",
    "shown": True, "why_not": None, "level": 0, "zone_low": 58.0, "zone_high": 62.0,
}  # fmt: skip


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Database]:
    write_database(tmp_path / "a.db")
    with closing(Database(tmp_path / "a.db")) as opened:
        yield opened


def open_take(db: Database, code: str = "P") -> tuple[str, str]:
    """Ids of a session and its take."""
    with db.write() as c:
        session = sessions.create(c, None, patients.create(c, None, code=code).id).id
        return session, live.open_take(c, None, session)[0].id


def written(db: Database, take: str) -> list[tuple[Any, ...]]:
    with db.read() as c:
        mine = select(live_event.c.kind, live_event.c.t_s, live_event.c.content).where(
            live_event.c.take_id == take
        )
        return [tuple(row) for row in c.execute(mine.order_by(live_event.c.seq))]


def test_rows_are_written_in_their_order_and_those_of_erased_takes_go(db: Database) -> None:
    _, take = open_take(db)
    _, erased = open_take(db, "Q")
    journal = Journal(db)
    journal.add(take, "notice", 1.0, {"code": "a"})
    journal.add(erased, "notice", 2.0, {"code": "b"})
    journal.add(take, "calibration", None, {"code": "c"})
    assert written(db, take) == []
    with db.write() as c:
        c.execute(delete(live_take).where(live_take.c.id == erased))
    journal.write()
    journal.write()
    assert written(db, take) == [("notice", 1.0, {"code": "a"}), ("calibration", None, {"code": "c"})]
    assert written(db, erased) == []


@pytest.mark.parametrize("shown", [True, False])
def test_a_session_was_walked_with_feedback_once_a_cue_was_shown(db: Database, shown: bool) -> None:
    session, take = open_take(db)
    journal = Journal(db)
    journal.add(take, "cue", 2.0, CUE | {"shown": shown, "why_not": None if shown else "off"})
    journal.write()
    assert len(written(db, take)) == 1
    with db.read() as c:
        assert sessions.get(c, session).feedback == shown


def test_what_a_busy_database_refuses_is_written_later_before_what_came_meanwhile(
    db: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite_file, "BUSY_TIMEOUT_MS", 1)
    _, take = open_take(db)
    with closing(Database(tmp_path / "a.db")) as mine:
        journal = Journal(mine)
        note_refusal = DiskLog.note_refusal

        def tell(disk: DiskLog, error: BaseException, label: str) -> None:
            note_refusal(disk, error, label)
            journal.add(take, "notice", 2.0, {})

        monkeypatch.setattr(DiskLog, "note_refusal", tell)
        journal.add(take, "notice", 1.0, {})
        with db.write():
            journal.write()
        assert written(db, take) == []
        journal.write()
    assert [row[1] for row in written(db, take)] == [1.0, 2.0]


def test_the_thread_writes_by_itself_and_the_end_leaves_nothing_behind(db: Database) -> None:
    _, take = open_take(db)
    journal = Journal(db, interval_s=0.0)
    journal.start()
    journal.add(take, "notice", 1.0, {})
    journal.stop()
    assert len(written(db, take)) == 1
    Journal(db).stop()  # one that was never started
