"""Transactions that begin by a statement of ours, and single statements that begin none."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from sqlalchemy import Engine, create_engine, event
from sqlalchemy.pool import StaticPool

from sagittal.server.storage.single import begin_with, without_transactions


@pytest.fixture
def engine() -> Iterator[Engine]:
    """In-memory database whose driver begins no transactions."""
    result = create_engine("sqlite://", poolclass=StaticPool, connect_args={"isolation_level": None})
    begin_with(result, "BEGIN IMMEDIATE")
    yield result
    result.dispose()


def sent(engine: Engine) -> list[str]:
    """Every statement that goes to the driver from now on."""
    names: list[str] = []
    event.listen(engine, "before_cursor_execute", lambda *said: names.append(said[2]))
    return names


def test_a_transaction_begins_by_our_statement_and_ends_as_one(engine: Engine) -> None:
    result = sent(engine)
    with engine.begin() as c:
        c.exec_driver_sql("CREATE TABLE t (n INTEGER)")

    def half() -> None:
        with engine.begin() as c:
            c.exec_driver_sql("INSERT INTO t VALUES (1)")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        half()
    with engine.begin() as c:
        assert c.exec_driver_sql("SELECT count(*) FROM t").scalar() == 0
    assert result.count("BEGIN IMMEDIATE") == 3
    assert result[0] == "BEGIN IMMEDIATE"


def test_a_single_statement_is_sent_alone_and_on_the_same_connections(engine: Engine) -> None:
    with engine.begin() as c:
        c.exec_driver_sql("CREATE TABLE t (n INTEGER)")
    single = without_transactions(engine)
    result = sent(engine)
    with single.connect() as c:
        assert c.exec_driver_sql("SELECT count(*) FROM t").scalar() == 0
    assert result == ["SELECT count(*) FROM t"]
    with engine.connect() as c:
        c.exec_driver_sql("SELECT 1")
    assert result[1:] == ["BEGIN IMMEDIATE", "SELECT 1"]


def test_a_percent_sign_in_the_statement_is_no_parameter() -> None:
    result = create_engine("sqlite://", connect_args={"isolation_level": None})
    begin_with(result, "BEGIN /* 100 % */")
    with result.begin() as c:
        assert c.exec_driver_sql("SELECT 1").scalar() == 1
    result.dispose()
