"""Rows that may not be changed or deleted."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from sqlalchemy import Column, Connection, Integer, MetaData, Table, create_engine, delete, insert, update
from sqlalchemy.exc import IntegrityError

from sagittal.server.storage.schema.append_only import make_append_only, write_triggers

KEEP = "Rows of this log stay."


@pytest.fixture
def log() -> Table:
    table = Table("log", MetaData(), Column("seq", Integer, primary_key=True), Column("n", Integer))
    make_append_only(table, ("UPDATE", "DELETE"), KEEP)
    return table


@pytest.fixture
def connection(log: Table) -> Iterator[Connection]:
    engine = create_engine("sqlite://")
    log.metadata.create_all(engine)
    with engine.begin() as c:
        c.execute(insert(log).values(seq=1, n=1))
        yield c
    engine.dispose()


def test_a_table_refuses_changes_with_its_sentence_and_takes_new_rows(
    connection: Connection, log: Table
) -> None:
    for statement in (update(log).values(n=2), delete(log)):
        with pytest.raises(IntegrityError, match=KEEP):
            connection.execute(statement)
    connection.execute(insert(log).values(seq=2, n=2))
    assert connection.exec_driver_sql("SELECT seq, n FROM log").all() == [(1, 1), (2, 2)]


def test_only_the_verbs_that_are_named_are_refused() -> None:
    table = Table("kept", MetaData(), Column("n", Integer))
    make_append_only(table, ("DELETE",), KEEP)
    engine = create_engine("sqlite://")
    table.metadata.create_all(engine)
    with engine.begin() as c:
        c.execute(insert(table).values(n=1))
        c.execute(update(table).values(n=2))
        with pytest.raises(IntegrityError, match=KEEP):
            c.execute(delete(table))
    engine.dispose()


def test_postgres_refuses_truncation_with_deletion_and_only_with_it() -> None:
    refuse, *result = write_triggers("postgresql", "log", ("UPDATE", "DELETE"), KEEP)
    assert refuse.startswith("CREATE OR REPLACE FUNCTION refuse_change()")
    call = f"EXECUTE FUNCTION refuse_change('{KEEP}')"
    assert result == [
        f"CREATE TRIGGER log_no_update BEFORE UPDATE ON log FOR EACH ROW {call}",
        f"CREATE TRIGGER log_no_delete BEFORE DELETE ON log FOR EACH ROW {call}",
        f"CREATE TRIGGER log_no_truncate BEFORE TRUNCATE ON log FOR EACH STATEMENT {call}",
    ]
    assert len(write_triggers("postgresql", "log", ("UPDATE",), KEEP)) == 2


def test_a_table_on_sqlite_gets_none_of_the_statements_of_postgres(connection: Connection) -> None:
    scalars = connection.exec_driver_sql("SELECT name FROM sqlite_master WHERE type = 'trigger'").scalars()
    assert sorted(scalars) == ["log_no_delete", "log_no_update"]
