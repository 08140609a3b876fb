from __future__ import annotations

import datetime as dt
import multiprocessing
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import insert, select, update
from sqlalchemy.exc import DBAPIError, IntegrityError, StatementError

from sagittal.server.storage.db import Database, Source
from sagittal.server.storage.migrate import copy_database
from sagittal.server.storage.schema.tables import new_id, now, patient, session

WRITERS, ROUNDS = 50, 4


@pytest.fixture
def db(source: Source) -> Iterator[Database]:
    opened = Database(source)
    yield opened
    opened.close()


def add_patient(db: Database, code: str) -> str:
    patient_id = new_id()
    with db.write() as c:
        c.execute(insert(patient).values(id=patient_id, code=code, note="", created_at=now()))
    return patient_id


def test_an_error_rolls_back_everything(db: Database) -> None:
    def half() -> None:
        with db.write() as c:
            c.execute(insert(patient).values(id=new_id(), code="a", note="", created_at=now()))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        half()
    with db.read() as c:
        assert c.execute(select(patient)).all() == []


def test_the_reading_view_refuses_to_write(db: Database) -> None:
    with pytest.raises(DBAPIError, match=r"read-?only"), db.read() as c:
        c.execute(insert(patient).values(id=new_id(), code="a", note="", created_at=now()))


def test_a_reader_sees_one_snapshot_and_never_waits_for_a_writer(db: Database) -> None:
    add_patient(db, "a")
    with db.read() as reader:
        assert len(reader.execute(select(patient)).all()) == 1
        with db.write() as c:
            c.execute(insert(patient).values(id=new_id(), code="b", note="", created_at=now()))
        assert len(reader.execute(select(patient)).all()) == 1
    with db.read() as reader:
        assert len(reader.execute(select(patient)).all()) == 2


def test_clinical_rows_do_not_vanish_with_what_they_refer_to(db: Database) -> None:
    patient_id = add_patient(db, "a")
    with db.write() as c:
        c.execute(
            insert(session).values(
                id=new_id(),
                patient_id=patient_id,
                title="t",
                performed_on=dt.date(2026, 1, 2),
                protocol="walk",
                note="",
                created_at=now(),
            )
        )
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), db.write() as c:
        c.execute(patient.delete())


def test_times_come_back_aware_in_utc_and_naive_ones_are_refused(db: Database) -> None:
    moment = dt.datetime(2026, 3, 29, 3, 30, tzinfo=dt.timezone(dt.timedelta(hours=2)))
    with db.write() as c:
        c.execute(insert(patient).values(id=new_id(), code="a", note="", created_at=moment))
        stored = c.execute(select(patient.c.created_at)).scalar_one()
    assert stored == moment
    assert stored.tzinfo is dt.UTC
    with pytest.raises(StatementError, match="no time zone"), db.write() as c:
        c.execute(insert(patient).values(id=new_id(), code="b", note="", created_at=dt.datetime(2026, 1, 1)))  # noqa: DTZ001


def test_values_outside_their_domain_are_refused_by_the_database_itself(db: Database) -> None:
    for wrong in ({"sex": "x"}, {"height_m": 175.0}, {"birth_year": 85}):
        with pytest.raises(IntegrityError, match=r"(?i)check"), db.write() as c:
            c.execute(insert(patient).values(id=new_id(), code="a", note="", created_at=now(), **wrong))


def test_a_watch_sees_commits_of_others_once(db: Database) -> None:
    with db.watch() as changes:
        assert changes.has_changed()
        assert not changes.has_changed()
        add_patient(db, "a")
        assert changes.has_changed()
        assert not changes.has_changed()


def test_a_backup_under_way_of_writing_is_whole(db: Database, tmp_path: Path) -> None:
    add_patient(db, "a")
    with db.write() as c:
        c.execute(insert(patient).values(id=new_id(), code="b", note="", created_at=now()))
        copy_database(db.source, tmp_path / "backup.db")
    copy = Database(tmp_path / "backup.db")
    assert copy.problems() == []
    with copy.read() as c:
        assert c.execute(select(patient.c.code)).scalars().all() == ["a"]
    copy.close()


def _count_up(source: Source, writers: int) -> None:
    import threading

    db = Database(source)

    def write() -> None:
        for _ in range(ROUNDS):
            with db.write() as c:
                height = c.execute(select(patient.c.birth_year)).scalar_one()
                c.execute(update(patient).values(birth_year=height + 1))

    threads = [threading.Thread(target=write) for _ in range(writers)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    db.close()


@pytest.mark.sweep
def test_fifty_concurrent_writers_lose_no_update(db: Database) -> None:
    add_patient(db, "a")
    with db.write() as c:
        c.execute(update(patient).values(birth_year=1850))
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=_count_up, args=(db.source, WRITERS // 5)) for _ in range(5)]
    for p in processes:
        p.start()
    for p in processes:
        p.join()
    assert [p.exitcode for p in processes] == [0] * 5
    with db.read() as c:
        assert c.execute(select(patient.c.birth_year)).scalar_one() == 1850 + WRITERS * ROUNDS
