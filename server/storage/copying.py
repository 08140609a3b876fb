"""Copies all rows between databases of the same revision, whatever their engines: moves and backups.

Tables are read from the databases rather than from this version, as they may be older before an upgrade.
"""

from __future__ import annotations

from sqlalchemy import JSON, Connection, MetaData, Table, func, insert, select

from sagittal.server.storage.db import highest_number, raise_number
from sagittal.server.storage.schema.columns import Json

_AT_ONCE = 500
"""Rows in memory at a time."""
_ALEMBIC = "alembic_version"


def copy_rows(source: Connection, target: Connection) -> bool:
    """Copy all rows in the transaction of `target`; False without copying if it contains any."""
    theirs, ours = _reflect(source), _reflect(target)
    tables = [ours.tables[table.name] for table in theirs.sorted_tables if table.name != _ALEMBIC]
    if any(target.execute(select(func.count()).select_from(table)).scalar_one() for table in tables):
        return False
    for table in tables:
        _copy_table(source, theirs.tables[table.name], target, table)
    return True


def _copy_table(source: Connection, old: Table, target: Connection, new: Table) -> None:
    columns = [old.c[column.name] for column in new.columns]
    query = select(*columns).order_by(*old.primary_key.columns)
    rows = source.execution_options(yield_per=_AT_ONCE).execute(query)
    for part in rows.mappings().partitions():
        target.execute(insert(new), [dict(row) for row in part])
    if new.primary_key.columns.keys() == ["seq"] and (number := highest_number(source, old.name)):
        raise_number(target, new.name, number)


def _reflect(c: Connection) -> MetaData:
    reflected = MetaData()
    reflected.reflect(c)
    for table in reflected.tables.values():
        for column in table.columns:
            if isinstance(column.type, JSON):
                column.type = Json  # no value is NULL, not the JSON null
    return reflected
