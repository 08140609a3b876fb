"""Steps of migrations on either engine."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from alembic.migration import MigrationContext
from alembic.operations import Operations
from sqlalchemy import create_engine
from sqlalchemy.exc import IntegrityError

from sagittal.server.storage.migration_steps import forbid_changes, is_sqlite, rebuild


@contextmanager
def written_for(dialect: str) -> Iterator[io.StringIO]:
    """SQL that a migration would send to an engine."""
    sent = io.StringIO()
    context = MigrationContext.configure(dialect_name=dialect, opts={"as_sql": True, "output_buffer": sent})
    with Operations.context(context):
        yield sent


@pytest.mark.parametrize(
    ("dialect", "sqlite", "how"), [("sqlite", True, "always"), ("postgresql", False, "never")]
)
def test_sqlite_changes_a_table_by_a_copy_and_postgres_in_place(dialect: str, sqlite: bool, how: str) -> None:
    with written_for(dialect):
        assert is_sqlite() is sqlite
        assert rebuild() == how


def test_each_engine_gets_its_own_triggers() -> None:
    with written_for("postgresql") as sent:
        forbid_changes("log", ("DELETE",), "Rows stay.")
    assert "CREATE TRIGGER log_no_truncate" in sent.getvalue()
    with written_for("sqlite") as sent:
        forbid_changes("log", ("DELETE",), "Rows stay.")
    assert "RAISE(ABORT, 'Rows stay.')" in sent.getvalue()
    assert "refuse_change" not in sent.getvalue()


def test_a_migrated_table_refuses_deletion() -> None:
    engine = create_engine("sqlite://")
    with engine.connect() as c:
        c.exec_driver_sql("CREATE TABLE log (n INTEGER)")
        c.exec_driver_sql("INSERT INTO log VALUES (1)")
        with Operations.context(MigrationContext.configure(c)):
            forbid_changes("log", ("DELETE",), "Rows stay.")
        with pytest.raises(IntegrityError, match=r"Rows stay\."):
            c.exec_driver_sql("DELETE FROM log")
    engine.dispose()
