"""The database: one SQLite file, two views on it, and the only raw SQLite statements of the server.

    db = Database(settings.database)
    with db.write() as c:  c.execute(insert(patient).values(...))   # BEGIN IMMEDIATE; commit, or rollback
    with db.read() as c:   c.execute(select(patient)).all()         # BEGIN: one snapshot, writing refused

Why two views (measured, three processes of 150 read-modify-writes each): SQLAlchemy's default lost 229
updates silently, deferred BEGIN gave 224 errors that busy_timeout cannot help, BEGIN IMMEDIATE lost none.
FULL costs one fsync per commit; a clinic writes rarely.
"""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.pool import ConnectionPoolEntry

MAX_READERS = 45
"""Connections beyond the five that are kept open: more than a web process has threads."""
BUSY_TIMEOUT_MS = 5000
"""How long a writer waits for another one before SQLITE_BUSY."""


class Database:
    """Both views on one SQLite file; opening neither creates tables nor migrates (storage/migrate.py does).

    Parameters
    ----------
    path : the database file; its folder must exist.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        # threads of one process queue here in turn; SQLite's own waiting is a lottery that somebody may lose
        self._turn = threading.RLock()
        self._writer = _engine(path, begin="BEGIN IMMEDIATE", query_only=False)
        self._reader = _engine(path, begin="BEGIN", query_only=True)

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """One transaction that holds the write lock from its first statement; commits at the block's end."""
        with self._turn, self._writer.begin() as connection:
            yield connection

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """One snapshot; every statement of the block sees the same state, writing raises OperationalError."""
        with self._reader.begin() as connection:
            yield connection

    @contextmanager
    def watch(self) -> Iterator[ChangeWatch]:
        """Keep one connection that can tell cheaply whether anybody has committed since it was last asked."""
        with closing(self._plain()) as connection:
            yield ChangeWatch(connection)

    def problems(self) -> list[str]:
        """Complaints of SQLite's own checks: page structure, indexes, CHECK and NOT NULL, foreign keys."""
        with self.read() as c:
            rows = [str(row[0]) for row in c.exec_driver_sql("PRAGMA integrity_check(100)")]
            dangling = foreign_key_violations(c)
        return ([] if rows == ["ok"] else rows) + dangling

    def probe(self) -> None:
        """Commit a change of one page, without touching a table; raises OperationalError."""
        with self.write() as c:
            beats = c.exec_driver_sql("PRAGMA user_version").scalar_one()
            c.exec_driver_sql(f"PRAGMA user_version = {(beats + 1) % 2**31}")

    def backup(self, target: Path) -> None:
        """Write a consistent copy while others read and write (a plain copy is unusable under WAL)."""
        with closing(self._plain()) as connection:
            connection.execute("VACUUM INTO ?", (str(target),))

    def _plain(self) -> sqlite3.Connection:
        """A connection outside SQLAlchemy, for what may not run inside a transaction."""
        timeout = BUSY_TIMEOUT_MS / 1000
        return sqlite3.connect(self.path, timeout=timeout, isolation_level=None, check_same_thread=False)

    def fold(self) -> bool:
        """Move the write-ahead log into the file and empty it, what was deleted is gone then.

        False when somebody has been reading an older state all the time, so that the log had to stay.
        """
        with closing(self._plain()) as connection:
            busy = connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()[0]
        return not busy

    def close(self) -> None:
        """Close all connections; the last one to leave folds the write-ahead log into the file."""
        self._reader.dispose()
        self._writer.dispose()


class ChangeWatch:
    """Whether the file has changed, without reading any table."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._seen: int | None = None

    def has_changed(self) -> bool:
        """True at the first call and whenever another connection has committed since the last one."""
        version = int(self._connection.execute("PRAGMA data_version").fetchone()[0])
        changed = version != self._seen
        self._seen = version
        return changed


def highest_number(connection: Connection, table: str) -> int:
    """The greatest number that a table which never gives one twice has given, 0 = none yet."""
    query = "SELECT seq FROM sqlite_sequence WHERE name = ?"
    return int(connection.exec_driver_sql(query, (table,)).scalar() or 0)


def migration_engine(path: Path) -> Engine:
    """Return an engine for Alembic: BEGIN IMMEDIATE, foreign keys not enforced.

    A batch migration drops and renames whole tables; with enforcement on, references act on that (measured: a
    cascading child lost all its rows and foreign_key_check was clean). The pragma only works outside a
    transaction.
    """
    return _engine(path, begin="BEGIN IMMEDIATE", query_only=False, foreign_keys=False)


def foreign_key_violations(connection: Connection) -> list[str]:
    """Rows that refer to nothing, as sentences."""
    rows = connection.exec_driver_sql("PRAGMA foreign_key_check").all()
    return [f"row {rowid} of {table} refers to a missing row of {parent}" for table, rowid, parent, _ in rows]


def _engine(path: Path, *, begin: str, query_only: bool, foreign_keys: bool = True) -> Engine:
    # hide_parameters: an error's text goes to the log, and its parameters may be a patient's
    engine = create_engine(
        f"sqlite:///{path}",
        max_overflow=MAX_READERS,
        connect_args={"timeout": BUSY_TIMEOUT_MS / 1000},
        hide_parameters=True,
    )

    @event.listens_for(engine, "connect")
    def _prepare(connection: DBAPIConnection, entry: ConnectionPoolEntry) -> None:
        # None: the driver starts no transactions of its own; "begin" below is the only place that does
        connection.isolation_level = None
        _set_pragmas(connection, query_only, foreign_keys)

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        connection.exec_driver_sql(begin)

    return engine


def _set_pragmas(connection: DBAPIConnection, query_only: bool, foreign_keys: bool) -> None:
    """Set what SQLite keeps per connection: WAL, durable commits, enforced keys, zeroed deletions."""
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
