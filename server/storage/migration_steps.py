"""Steps that migrations take differently on SQLite and on PostgreSQL."""

from __future__ import annotations

from typing import Literal

from alembic import op

from sagittal.server.storage.schema.append_only import write_triggers


def is_sqlite() -> bool:
    """Whether the database under migration is an SQLite file."""
    return op.get_context().dialect.name == "sqlite"


def rebuild() -> Literal["always", "never"]:
    """How a batch changes a table: SQLite by a copy under its name, PostgreSQL in place."""
    return "always" if is_sqlite() else "never"


def forbid_changes(table: str, verbs: tuple[str, ...], sentence: str) -> None:
    """Let a table refuse UPDATE or DELETE with a sentence."""
    for statement in write_triggers(op.get_context().dialect.name, table, verbs, sentence):
        op.execute(statement)
