"""Explicit transaction starts, and single statements without a transaction, each its own snapshot.

For drivers that do not begin transactions.
"""

from __future__ import annotations

from typing import Final

from sqlalchemy import Connection, Engine, event

_SINGLE: Final = "sagittal_single"


def begin_with(engine: Engine, statement: str) -> None:
    """Begin every transaction of an engine with a statement, or several sent together."""

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        if not connection.get_execution_options().get(_SINGLE):
            connection.exec_driver_sql(statement, execution_options={"no_parameters": True})


def without_transactions(engine: Engine) -> Engine:
    """The same engine and connections, for single statements."""
    return engine.execution_options(**{_SINGLE: True})
