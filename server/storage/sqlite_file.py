"""SQLite-specific part of the database.

Measured, three processes of 150 read-modify-writes each: SQLAlchemy's default lost 229 updates silently,
deferred BEGIN gave 224 errors that busy_timeout cannot help, BEGIN IMMEDIATE lost none. FULL costs one fsync
per commit; a clinic writes rarely.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.pool import ConnectionPoolEntry

from sagittal.server.storage.single import begin_with

MAX_READERS = 45
"""Connections in addition to the five kept open: more than a web process has threads."""
BUSY_TIMEOUT_MS = 5000
"""How long a writer waits for another before SQLITE_BUSY."""


class SqliteFile:
    """A database in one file; its folder must exist."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def writer(self) -> Engine:
        """Engine whose transactions hold the write lock from their first statement."""
        return self._engine(begin="BEGIN IMMEDIATE")

    def reader(self) -> Engine:
        """Engine whose transactions see one snapshot and are read-only."""
        return self._engine(begin="BEGIN", query_only=True)

    def migrator(self) -> Engine:
        """Engine for Alembic: BEGIN IMMEDIATE, foreign keys not enforced.

        A batch migration drops and renames whole tables; with enforcement on, references act on that
        (measured: a cascading child lost all its rows and foreign_key_check was clean). The pragma only works
        outside a transaction.
        """
        return self._engine(begin="BEGIN IMMEDIATE", foreign_keys=False)

    @contextmanager
    def watch(self) -> Iterator[Callable[[], object]]:
        """Context with a query whose result changes with every commit of another connection."""
        with closing(self._plain()) as connection:
            yield lambda: connection.execute("PRAGMA data_version").fetchone()[0]

    def check(self, c: Connection) -> list[str]:
        """Errors of SQLite's own checks: page structure, indexes, CHECK and NOT NULL, foreign keys."""
        rows = [str(row[0]) for row in c.exec_driver_sql("PRAGMA integrity_check(100)")]
        return ([] if rows == ["ok"] else rows) + self.dangling(c)

    def dangling(self, c: Connection) -> list[str]:
        """Rows with dangling references, as sentences."""
        rows = c.exec_driver_sql("PRAGMA foreign_key_check").all()
        return [
            f"row {rowid} of {table} refers to a missing row of {parent}" for table, rowid, parent, _ in rows
        ]

    def probe(self, c: Connection) -> None:
        """Change one page in this transaction, without touching a table."""
        beats = c.exec_driver_sql("PRAGMA user_version").scalar_one()
        c.exec_driver_sql(f"PRAGMA user_version = {(beats + 1) % 2**31}")

    def highest_number(self, c: Connection, table: str) -> int:
        """See storage/db.py."""
        query = "SELECT seq FROM sqlite_sequence WHERE name = ?"
        return int(c.exec_driver_sql(query, (table,)).scalar() or 0)

    def raise_number(self, c: Connection, table: str, number: int) -> None:
        """See storage/db.py."""
        c.exec_driver_sql("DELETE FROM sqlite_sequence WHERE name = ?", (table,))
        c.exec_driver_sql("INSERT INTO sqlite_sequence (name, seq) VALUES (?, ?)", (table, number))

    def write_copy(self, target: Path) -> None:
        """Write a consistent copy of a database in use (a plain file copy is unusable under WAL)."""
        with closing(self._plain()) as connection:
            connection.execute("VACUUM INTO ?", (str(target),))

    def fold(self) -> bool:
        """Merge the write-ahead log into the file and empty it, which removes deleted data.

        False if a reader of an older state prevents it.
        """
        with closing(self._plain()) as connection:
            busy = connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()[0]
        return not busy

    def _plain(self) -> sqlite3.Connection:
        """Connection outside SQLAlchemy, for statements that cannot run in a transaction."""
        timeout = BUSY_TIMEOUT_MS / 1000
        return sqlite3.connect(self.path, timeout=timeout, isolation_level=None, check_same_thread=False)

    def _engine(self, *, begin: str, query_only: bool = False, foreign_keys: bool = True) -> Engine:
        # hide_parameters: error texts are logged, and parameters may contain patient data
        engine = create_engine(
            f"sqlite:///{self.path}",
            max_overflow=MAX_READERS,
            pool_use_lifo=True,  # the most recently used connection has cached pages
            connect_args={"timeout": BUSY_TIMEOUT_MS / 1000},
            hide_parameters=True,
        )

        @event.listens_for(engine, "connect")
        def _prepare(connection: DBAPIConnection, entry: ConnectionPoolEntry) -> None:
            # None: the driver starts no transactions itself
            connection.isolation_level = None
            _set_pragmas(connection, query_only, foreign_keys)

        begin_with(engine, begin)
        return engine


def _set_pragmas(connection: DBAPIConnection, query_only: bool, foreign_keys: bool) -> None:
    """Set per-connection options of SQLite: WAL, durable commits, enforced keys, zeroed deletions."""
    cursor = connection.cursor()
    for pragma in (
        f"busy_timeout={BUSY_TIMEOUT_MS}",
        "journal_mode=WAL",
        "synchronous=FULL",
        f"foreign_keys={'ON' if foreign_keys else 'OFF'}",
        "trusted_schema=OFF",
        "secure_delete=ON",
        f"query_only={'ON' if query_only else 'OFF'}",
    ):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()
