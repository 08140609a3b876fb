"""Migration steps that differ between SQLite and PostgreSQL."""

from __future__ import annotations

from typing import Literal

from alembic import op

from sagittal.server.storage.schema.append_only import write_triggers


def is_sqlite() -> bool:
    """Whether the database being migrated is an SQLite file."""
    return op.get_context().dialect.name == "sqlite"


def rebuild() -> Literal["always", "never"]:
    """Batch mode for altering a table: a copy on SQLite, in place on PostgreSQL."""
    return "always" if is_sqlite() else "never"


def forbid_changes(table: str, verbs: tuple[str, ...], sentence: str) -> None:
    """Make a table reject UPDATE or DELETE with an error message."""
    for statement in write_triggers(op.get_context().dialect.name, table, verbs, sentence):
        op.execute(statement)
