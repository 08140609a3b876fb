"""All rows of one database into another."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import insert, select

from sagittal.server import audit
from sagittal.server.clinic import patients, sessions
from sagittal.server.storage.copying import copy_rows
from sagittal.server.storage.db import Database, highest_number, raise_number
from sagittal.server.storage.schema.tables import audit as audit_table
from sagittal.server.storage.schema.tables import recording, session
from tests.helpers.databases import write_database


@pytest.fixture
def source(tmp_path: Path) -> Iterator[Database]:
    """A patient with two sessions; three rows of the audit log, the newest of which is gone."""
    write_database(tmp_path / "source.db")
    with closing(Database(tmp_path / "source.db")) as db:
        with db.write() as c:
            patient = patients.create(c, None, code="P-1").id
            for _ in range(2):
                sessions.create(c, None, patient)
        yield db


@pytest.fixture
def target(tmp_path: Path) -> Iterator[Database]:
    write_database(tmp_path / "target.db")
    with closing(Database(tmp_path / "target.db")) as db:
        yield db


def copy(source: Database, target: Database) -> bool:
    with source.read() as old, target.write() as new:
        return copy_rows(old, new)


def test_every_row_comes_over_and_numbers_go_on_behind_the_highest_ever_given(
    source: Database, target: Database
) -> None:
    with source.write() as c:
        raise_number(c, "job", 40)
        first = c.execute(select(session.c.id, session.c.created_at)).first()
        assert first is not None
        c.execute(insert(recording).values(id="r" * 32, session_id=first.id, created_at=first.created_at))
    assert copy(source, target)
    rows = []
    for db in (source, target):
        with db.read() as c:
            tables = (session, audit_table, recording)
            rows.append([c.execute(select(t).order_by(*t.primary_key.columns)).all() for t in tables])
            assert audit.find_problems(c) == []
            assert highest_number(c, "job") == 40
    assert rows[0] == rows[1]
    assert [len(result) for result in rows[0]] == [2, 3, 1]
    with target.read() as c:  # no value is NULL, not the word null
        assert c.exec_driver_sql("SELECT manifest IS NULL FROM recording").scalars().all() == [1]


def test_a_database_that_holds_any_row_is_left_as_it_is(source: Database, target: Database) -> None:
    with target.write() as c:
        patients.create(c, None, code="P-9")
    assert not copy(source, target)
    with target.read() as c:
        assert c.exec_driver_sql("SELECT code FROM patient").scalars().all() == ["P-9"]
