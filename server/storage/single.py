"""Transactions that begin by a statement of ours, and single statements, which are snapshots by themselves.

For drivers that begin none.
"""

from __future__ import annotations

from typing import Final

from sqlalchemy import Connection, Engine, event

_SINGLE: Final = "sagittal_single"


def begin_with(engine: Engine, statement: str) -> None:
    """Begin every transaction of an engine by a statement, or by several that are sent as one."""

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        if not connection.get_execution_options().get(_SINGLE):
            connection.exec_driver_sql(statement, execution_options={"no_parameters": True})


def without_transactions(engine: Engine) -> Engine:
    """The same engine, with its connections, for single statements."""
    return engine.execution_options(**{_SINGLE: True})
