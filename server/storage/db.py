"""Read and write access to the database, the same for an SQLite file and a PostgreSQL server.

    db = Database(settings.database_source)
    with db.write() as c:  c.execute(insert(patient).values(...))   # exclusive; commit, or rollback
    with db.read() as c:   c.execute(select(patient)).all()         # one snapshot, read-only
    db.ask(select(patient))                                         # the rows of a single statement

Engine-specific statements are confined to sqlite_file.py and postgres.py.
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
"""Location of a database: path of an SQLite file, or URL postgresql://user:password@host:port/database."""


class Database:
    """Read and write access to one database; neither creates tables nor migrates (see storage/migrate.py)."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self._engine = engine_of(source)
        # threads of one process queue here in order; SQLite's own waiting is unfair and may starve one
        self._turn = threading.RLock()
        self._writer = self._engine.writer()
        self._reader = self._engine.reader()
        self._asker = without_transactions(self._reader)

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """Transaction that holds the write lock from its first statement; commits at the end of the
        context.
        """
        with self._turn, self._writer.begin() as connection:
            yield connection

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """Snapshot in which every statement sees the same state; writing raises DBAPIError."""
        with self._reader.begin() as connection:
            yield connection

    def ask(self, query: Select[Any]) -> Sequence[Row[Any]]:
        """Rows of a single statement; on PostgreSQL in one round trip instead of three."""
        with self._asker.connect() as connection:
            return connection.execute(query).all()

    @contextmanager
    def watch(self) -> Iterator[ChangeWatch]:
        """Context with a cheap check for commits since the previous check."""
        with self._engine.watch() as ask:
            yield ChangeWatch(ask)

    def problems(self) -> list[str]:
        """Errors reported by the engine's own checks."""
        with self.read() as c:
            return self._engine.check(c)

    def probe(self) -> None:
        """Commit a change without touching a table; raises DBAPIError."""
        with self.write() as c:
            self._engine.probe(c)

    def fold(self) -> bool:
        """Physically remove deleted data from the files; False = readers prevent it."""
        return self._engine.fold()

    @contextmanager
    def serve(self, node: str) -> Iterator[bool]:
        """Register as web server of a PostgreSQL database, alone or under a name; False = not possible now.

        For SQLite files the lock file serves this purpose.
        """
        if isinstance(self._engine, PostgresServer):
            with self._engine.serve(node) as may_serve:
                yield may_serve
        else:
            yield True

    @contextmanager
    def do_alone(self, duty: str) -> Iterator[bool]:
        """Run a periodic task exclusively; False = another program runs it. Always True for SQLite files."""
        if isinstance(self._engine, PostgresServer):
            with self._engine.do_alone(duty) as is_mine:
                yield is_mine
        else:
            yield True

    def read_clock(self) -> float | None:
        """Time of the database host, seconds since 1970 UTC; None = it is this host."""
        if not isinstance(self._engine, PostgresServer):
            return None
        with self.read() as c:
            return self._engine.read_clock(c)

    def close(self) -> None:
        """Close all connections; the last one merges SQLite's write-ahead log into the file."""
        self._reader.dispose()
        self._writer.dispose()


class ChangeWatch:
    """Detects changes of the database without reading a table."""

    def __init__(self, ask: Callable[[], object]) -> None:
        self._ask = ask
        self._seen: object = None

    def has_changed(self) -> bool:
        """True at the first call and after a commit of another connection since the previous call."""
        word = self._ask()
        changed = word != self._seen
        self._seen = word
        return changed


def engine_of(source: Source) -> SqliteFile | PostgresServer:
    """Return the adapter for the engine of this database; raises ModuleNotFoundError without its driver."""
    return SqliteFile(source) if isinstance(source, Path) else PostgresServer(source)


def highest_number(connection: Connection, table: str) -> int:
    """Greatest number issued by a table that never reuses numbers, 0 = none yet.

    On PostgreSQL this holds for generated numbers; for others it is the greatest one present.
    """
    return _engine_behind(connection).highest_number(connection, table)


def raise_number(connection: Connection, table: str, number: int) -> None:
    """Make a table that never reuses numbers continue after this one, at least 1."""
    _engine_behind(connection).raise_number(connection, table, number)


def _engine_behind(connection: Connection) -> SqliteFile | PostgresServer:
    url = connection.engine.url
    if connection.dialect.name == "sqlite":
        return SqliteFile(Path(str(url.database)))
    return PostgresServer(url.render_as_string(hide_password=False))
