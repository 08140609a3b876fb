"""Triggers that prevent changing or deleting rows, on either engine."""

from __future__ import annotations

from typing import Final

from sqlalchemy import DDL, Table, event

_REFUSE: Final = (
    "CREATE OR REPLACE FUNCTION refuse_change() RETURNS trigger LANGUAGE plpgsql AS $$ "
    "BEGIN RAISE EXCEPTION USING MESSAGE = TG_ARGV[0], ERRCODE = 'integrity_constraint_violation'; END $$"
)


def write_triggers(dialect: str, table: str, verbs: tuple[str, ...], sentence: str) -> tuple[str, ...]:
    """Statements that make a table reject UPDATE or DELETE with an error message."""
    if dialect == "sqlite":
        return tuple(
            f"CREATE TRIGGER {table}_no_{verb.lower()} BEFORE {verb} ON {table} "
            f"BEGIN SELECT RAISE(ABORT, '{sentence}'); END"
            for verb in verbs
        )
    call = f"EXECUTE FUNCTION refuse_change('{sentence}')"
    statements = [
        f"CREATE TRIGGER {table}_no_{verb.lower()} BEFORE {verb} ON {table} FOR EACH ROW {call}"
        for verb in verbs
    ]
    if "DELETE" in verbs:
        statements.append(
            f"CREATE TRIGGER {table}_no_truncate BEFORE TRUNCATE ON {table} FOR EACH STATEMENT {call}"
        )
    return (_REFUSE, *statements)


def make_append_only(table: Table, verbs: tuple[str, ...], sentence: str) -> None:
    """Add these triggers to a table wherever it is created."""
    for dialect in ("sqlite", "postgresql"):
        for statement in write_triggers(dialect, table.name, verbs, sentence):
            ddl = DDL(statement).execute_if(dialect=dialect)  # type: ignore[no-untyped-call]
            event.listen(table, "after_create", ddl)
