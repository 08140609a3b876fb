"""The database, an SQLite file or a PostgreSQL server: two views on it, the same on both.

    db = Database(settings.database_source)
    with db.write() as c:  c.execute(insert(patient).values(...))   # alone; commit, or rollback
    with db.read() as c:   c.execute(select(patient)).all()         # one snapshot, writing refused
    db.ask(select(patient))                                         # the rows of a single statement

Statements of one engine stand in sqlite_file.py and postgres.py, and nowhere else.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Row, Select

from sagittal.server.storage.postgres import PostgresServer
from sagittal.server.storage.single import without_transactions
from sagittal.server.storage.sqlite_file import SqliteFile

Source = Path | str
"""Where a database is: the path of an SQLite file, or a URL postgresql://user:password@host:port/database."""


class Database:
    """Both views on one database; opening neither creates tables nor migrates (storage/migrate.py does)."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self._engine = engine_of(source)
        # threads of one process queue here in turn; SQLite's own waiting is a lottery that somebody may lose
        self._turn = threading.RLock()
        self._writer = self._engine.writer()
        self._reader = self._engine.reader()
        self._asker = without_transactions(self._reader)

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """One transaction that holds the write lock from its first statement; commits at the block's end."""
        with self._turn, self._writer.begin() as connection:
            yield connection

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """One snapshot; every statement of the block sees the same state, writing raises DBAPIError."""
        with self._reader.begin() as connection:
            yield connection

    def ask(self, query: Select[Any]) -> Sequence[Row[Any]]:
        """The rows of one statement; on PostgreSQL a word to the server instead of three."""
        with self._asker.connect() as connection:
            return connection.execute(query).all()

    @contextmanager
    def watch(self) -> Iterator[ChangeWatch]:
        """Tell cheaply whether anybody has committed since it was last asked."""
        with self._engine.watch() as ask:
            yield ChangeWatch(ask)

    def problems(self) -> list[str]:
        """Complaints of the engine's own checks."""
        with self.read() as c:
            return self._engine.check(c)

    def probe(self) -> None:
        """Commit a change without touching a table; raises DBAPIError."""
        with self.write() as c:
            self._engine.probe(c)

    def fold(self) -> bool:
        """Remove from the files what was deleted from the tables; False = it is still being read."""
        return self._engine.fold()

    @contextmanager
    def serve(self, node: str) -> Iterator[bool]:
        """Be a web server on a PostgreSQL database: alone, or with a name beside others; False = not now.

        Files have their lock.
        """
        if isinstance(self._engine, PostgresServer):
            with self._engine.serve(node) as may_serve:
                yield may_serve
        else:
            yield True

    @contextmanager
    def do_alone(self, duty: str) -> Iterator[bool]:
        """Do a periodic duty (a word) while no other program does; False = one does. A file: always True."""
        if isinstance(self._engine, PostgresServer):
            with self._engine.do_alone(duty) as is_mine:
                yield is_mine
        else:
            yield True

    def read_clock(self) -> float | None:
        """Time of the database's host, seconds since 1970 UTC; None = it is this host."""
        if not isinstance(self._engine, PostgresServer):
            return None
        with self.read() as c:
            return self._engine.read_clock(c)

    def close(self) -> None:
        """Close all connections; the last one to leave folds SQLite's write-ahead log into the file."""
        self._reader.dispose()
        self._writer.dispose()


class ChangeWatch:
    """Whether the database has changed, without reading any table."""

    def __init__(self, ask: Callable[[], object]) -> None:
        self._ask = ask
        self._seen: object = None

    def has_changed(self) -> bool:
        """True at the first call and whenever another connection has committed since the last one."""
        word = self._ask()
        changed = word != self._seen
        self._seen = word
        return changed


def engine_of(source: Source) -> SqliteFile | PostgresServer:
    """Return what knows the engine of this database; raises ModuleNotFoundError without its driver."""
    return SqliteFile(source) if isinstance(source, Path) else PostgresServer(source)


def highest_number(connection: Connection, table: str) -> int:
    """The greatest number that a table which never gives one twice has given, 0 = none yet.

    On PostgreSQL only for numbers that it gives itself; of those that we give the greatest that is there.
    """
    return _engine_behind(connection).highest_number(connection, table)


def raise_number(connection: Connection, table: str, number: int) -> None:
    """Let a table that never gives a number twice go on after this one, at least 1."""
    _engine_behind(connection).raise_number(connection, table, number)


def _engine_behind(connection: Connection) -> SqliteFile | PostgresServer:
    url = connection.engine.url
    if connection.dialect.name == "sqlite":
        return SqliteFile(Path(str(url.database)))
    return PostgresServer(url.render_as_string(hide_password=False))
