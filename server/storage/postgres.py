"""PostgreSQL-specific part of the database (psycopg 3, the extra `postgres`).

Writing transactions first acquire one advisory lock, like BEGIN IMMEDIATE on SQLite: a transaction that reads
before it writes sees the previous commit, and the audit log cannot fork. Reading transactions see one
snapshot.

Each round trip to the server costs two context switches, which are slow on a busy machine. Therefore the
driver begins no transactions (BEGIN and lock are sent together, a single statement needs none), and
connections are checked before use only if data have arrived on them or they were idle for long.
"""

from __future__ import annotations

import select
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, inspect, make_url
from sqlalchemy.engine import ExceptionContext
from sqlalchemy.exc import DBAPIError, InvalidatePoolError, OperationalError
from sqlalchemy.pool import ConnectionPoolEntry

from sagittal.server.storage.schema.columns import metadata
from sagittal.server.storage.single import begin_with

MAX_READERS = 45
"""As on SQLite; PostgreSQL's own limit, 100 in all, is shared by all programs."""
WAIT_MS = 5000
"""How long a writer waits for another before it fails as busy."""
MIGRATION_WAIT_MS = 120_000
"""How long a program waits for another migration."""
FORGOTTEN_S = 60
"""A writing transaction of a frozen or unreachable program is terminated after this idle time."""
IDLE_S = 5.0
"""Connections unused for this long are checked, as they may have broken silently."""
WRITING, SERVING = 0x5A610001, 0x5A610002
"""Advisory locks: the writer, and the web server of a database; shared by several."""
MIGRATING = 0x5A610005
"""Lock of the migrating program; others wait."""
NODES, DUTIES = 0x5A610003, 0x5A610004
"""First keys of the locks of one of several web servers, and of one periodic task."""
FULL = ("too many clients", "remaining connection slots", "too many connections")
"""PostgreSQL's messages for lack of connections; there is no error code before connecting."""
APPLICATION = "sagittal"
"""Application name shown in PostgreSQL's list of connections."""
DELIVERY_SCHEMA = "procrastinate"
"""PostgreSQL schema of procrastinate's tables for delivering job ids; not part of backups."""


class PostgresServer:
    """A database on a PostgreSQL server.

    Parameters
    ----------
    url : postgresql://user:password@host:port/database; omitted parts are taken from libpq's sources
        (PGPASSFILE etc.).
    """

    def __init__(self, url: str) -> None:
        self._url = make_url(url).set(drivername="postgresql+psycopg")
        self.name = self._url.set(drivername="postgresql").render_as_string(hide_password=True)

    def writer(self) -> Engine:
        """Engine whose transactions hold the write lock from their first statement."""
        return self._locking(WAIT_MS, idle_in_transaction_session_timeout=f"{FORGOTTEN_S}s")

    def reader(self) -> Engine:
        """Engine whose transactions see one snapshot and are read-only."""
        engine = self._engine(WAIT_MS, default_transaction_read_only="on")
        begin_with(engine, "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY")
        return engine

    def migrator(self) -> Engine:
        """Engine for Alembic; a second migrating program waits for the first and then has nothing to do."""
        return self._locking(MIGRATION_WAIT_MS)

    def has_delivery(self, c: Connection) -> bool:
        """Whether the tables of the installed procrastinate exist; raises ModuleNotFoundError."""
        from procrastinate import __version__ as version

        query = "SELECT obj_description(to_regnamespace(%s), 'pg_namespace')"
        return bool(c.exec_driver_sql(query, (DELIVERY_SCHEMA,)).scalar_one() == version)

    def prepare_delivery(self) -> None:
        """Create these tables, replacing those of another version; polling covers deliveries lost thereby."""
        from procrastinate import __version__ as version
        from procrastinate.schema import SchemaManager

        engine = self.migrator()
        try:
            with engine.begin() as c:
                if self.has_delivery(c):
                    return
                c.exec_driver_sql(f"DROP SCHEMA IF EXISTS {DELIVERY_SCHEMA} CASCADE")
                c.exec_driver_sql(f"CREATE SCHEMA {DELIVERY_SCHEMA}")
                c.exec_driver_sql(f"SET LOCAL search_path TO {DELIVERY_SCHEMA}")
                # several statements at once must not have parameters: SQLAlchemy would pass an empty set
                c.connection.cursor().execute(SchemaManager.get_schema())
                c.exec_driver_sql(f"COMMENT ON SCHEMA {DELIVERY_SCHEMA} IS '{version}'")
        finally:
            engine.dispose()

    @contextmanager
    def watch(self) -> Iterator[Callable[[], object]]:
        """Context with a query whose result changes with every commit that wrote data."""
        engine = self._engine(WAIT_MS)

        def ask() -> object:
            with engine.connect() as c:
                return c.exec_driver_sql("SELECT pg_current_snapshot()::text").scalar_one()

        try:
            yield ask
        finally:
            engine.dispose()

    def check(self, c: Connection) -> list[str]:
        """Read every row; PostgreSQL reports pages with wrong checksums (initdb --data-checksums)."""
        problems = []
        for name in inspect(c).get_table_names():
            try:
                with c.begin_nested():
                    quoted = c.dialect.identifier_preparer.quote(name)
                    c.exec_driver_sql(f"SELECT max(length(t::text)) FROM {quoted} AS t")  # noqa: S608
            except DBAPIError as error:
                problems.append(f"{name} cannot be read ({error.orig})")
        return problems

    def dangling(self, c: Connection) -> list[str]:
        """Return nothing: PostgreSQL enforces references at every statement, also in migrations."""
        return []

    def probe(self, c: Connection) -> None:
        """Write into the write-ahead log in this transaction, without touching a table."""
        c.exec_driver_sql("SELECT pg_logical_emit_message(true, 'sagittal', 'probe')")

    def highest_number(self, c: Connection, table: str) -> int:
        """See storage/db.py; from the sequence for generated numbers, otherwise from the newest row."""
        quoted = c.dialect.identifier_preparer.quote(table)
        generated = c.exec_driver_sql(
            "SELECT last_value FROM pg_sequences WHERE schemaname || '.' || sequencename "
            "= pg_get_serial_sequence(%s, 'seq')",
            (quoted,),
        ).scalar()
        newest = c.exec_driver_sql(f"SELECT max(seq) FROM {quoted}").scalar()  # noqa: S608
        return max(int(generated or 0), int(newest or 0))

    def raise_number(self, c: Connection, table: str, number: int) -> None:
        """See storage/db.py."""
        quoted = c.dialect.identifier_preparer.quote(table)
        c.exec_driver_sql("SELECT setval(pg_get_serial_sequence(%s, 'seq'), %s)", (quoted, number))

    def fold(self) -> bool:
        """Rewrite the tables, which removes deleted data (but not from PostgreSQL's own log yet).

        False if a reader of an older state prevents it.
        """
        engine = self._engine(WAIT_MS)
        try:
            with engine.connect() as c:
                if not _outlive_readers(c):
                    return False
                for table in metadata.sorted_tables:
                    c.exec_driver_sql(f"VACUUM FULL {c.dialect.identifier_preparer.format_table(table)}")
        except OperationalError:
            return False
        finally:
            engine.dispose()
        return True

    @contextmanager
    def hold(self, *questions: str, wait_ms: int = WAIT_MS) -> Iterator[bool]:
        """Hold advisory locks within the context or until the connection breaks; False = one is taken."""
        engine = self._engine(wait_ms)
        try:
            with engine.connect() as c:
                yield all(c.exec_driver_sql(f"SELECT {one}").scalar_one() for one in questions)
        finally:
            engine.dispose()

    def serve(self, node: str) -> AbstractContextManager[bool]:
        """Hold the locks of a web server: exclusive without a name, otherwise shared with other names."""
        if not node:
            return self.hold(f"pg_try_advisory_lock({SERVING})")
        return self.hold(
            f"pg_try_advisory_lock_shared({SERVING})", f"pg_try_advisory_lock({NODES}, {_number(node)})"
        )

    def take_turn_to_migrate(self) -> AbstractContextManager[bool]:
        """Wait for the migration lock and hold it; raises OperationalError after two minutes."""
        return self.hold(f"pg_advisory_lock({MIGRATING}) IS NOT NULL", wait_ms=MIGRATION_WAIT_MS)

    def list_others(self) -> list[str]:
        """Hosts of other Sagittal programs on this database, except servers and migrating programs."""
        engine = self.reader()
        try:
            with engine.connect() as c:
                rows = c.exec_driver_sql(
                    "SELECT DISTINCT coalesce(host(client_addr), 'this computer') FROM pg_stat_activity AS a "
                    "WHERE datname = current_database() AND application_name = %s "
                    "AND pid <> pg_backend_pid() AND NOT EXISTS (SELECT FROM pg_locks WHERE pid = a.pid "
                    "AND locktype = 'advisory' AND objsubid = 1 AND objid::bigint IN (%s, %s)) ORDER BY 1",
                    (APPLICATION, SERVING, MIGRATING),
                )
                return list(rows.scalars())
        finally:
            engine.dispose()

    def do_alone(self, duty: str) -> AbstractContextManager[bool]:
        """Hold the lock of a task that runs in one program at a time."""
        return self.hold(f"pg_try_advisory_lock({DUTIES}, {_number(duty)})")

    def read_clock(self, c: Connection) -> float:
        """Server time, seconds since 1970 UTC."""
        return float(c.exec_driver_sql("SELECT extract(epoch FROM clock_timestamp())").scalar_one())

    def explain(self, error: DBAPIError) -> str:
        """Reason why the server cannot be used, and the remedy."""
        text = " ".join(str(error.orig).split())
        attempt = getattr(error.orig, "pgconn", None)
        if any(words in text for words in FULL):
            return (
                f"PostgreSQL has no connection left for {self.name} ({text}). Raise its max_connections, "
                "or run fewer workers: each keeps two, a web server up to 56."
            )
        is_refused = attempt is not None and (attempt.needs_password or attempt.used_password)
        if is_refused or "FATAL" in text:
            return (
                f"PostgreSQL refused {self.name} ({text}). Check user, password and the database's name in "
                "SAGITTAL_DATABASE_URL."
            )
        return (
            f"PostgreSQL is not reached at {self.name} ({text}). Check that it runs, and address and port in "
            "SAGITTAL_DATABASE_URL."
        )

    def _locking(self, wait_ms: int, **parameters: str) -> Engine:
        engine = self._engine(wait_ms, **parameters)
        begin_with(engine, f"BEGIN; SELECT pg_advisory_xact_lock({WRITING})")
        return engine

    def _engine(self, wait_ms: int, **more: str) -> Engine:
        """Engine in autocommit mode unless configured to begin transactions."""
        parameters = {
            "timezone": "UTC",
            "synchronous_commit": "on",
            "lock_timeout": wait_ms,
            # locks of an unreachable computer are released within a minute
            "tcp_keepalives_idle": 30,
            "tcp_keepalives_interval": 10,
            "tcp_keepalives_count": 3,
            # queries of pages are short: compiling them costs more than it saves
            "jit": "off",
            **more,
        }
        engine = create_engine(
            self._url,
            max_overflow=MAX_READERS,
            pool_use_lifo=True,  # the most recently used connection has prepared statements
            hide_parameters=True,
            connect_args={
                "autocommit": True,
                "connect_timeout": 10,
                "application_name": APPLICATION,
                "options": " ".join(f"-c {name}={value}" for name, value in parameters.items()),
            },
        )
        event.listen(engine, "handle_error", _hide_details)
        _renew_broken(engine)
        return engine


def _renew_broken(engine: Engine) -> None:
    """Replace the connections of the pool if PostgreSQL was restarted since their last use.

    A terminating server sends a message on the connection, which is otherwise silent when idle, so this can
    be detected without a round trip.
    """
    refused = engine.dialect.loaded_dbapi.Error

    @event.listens_for(engine, "checkin")
    def _note_use(_: object, entry: ConnectionPoolEntry) -> None:
        entry.info["used_at"] = time.monotonic()

    @event.listens_for(engine, "checkout")
    def _look(connection: Any, entry: ConnectionPoolEntry, _: object) -> None:
        used_at = entry.info.get("used_at")
        if used_at is None:
            return
        line = select.poll()
        try:
            line.register(connection.fileno(), select.POLLIN)
            if line.poll(0) or time.monotonic() - used_at > IDLE_S:
                connection.execute("")
        except refused as error:
            raise InvalidatePoolError from error


def _number(word: str) -> int:
    """Hash of a name as a signed 32-bit number."""
    return zlib.crc32(word.encode()) - 2**31


def _hide_details(context: ExceptionContext) -> None:
    """Remove row values from an error's text, as they may contain patient data and would be logged."""
    raw, wrapped = context.original_exception, context.sqlalchemy_exception
    short = getattr(getattr(raw, "diag", None), "message_primary", None)
    if short is None:
        return
    text, raw.args = str(raw), (short,)
    if wrapped is not None:
        wrapped.args = tuple(str(part).replace(text, short) for part in wrapped.args)


def _outlive_readers(c: Connection) -> bool:
    """Wait until all transactions that can still see deleted data have ended; False on timeout."""
    began = c.exec_driver_sql("SELECT clock_timestamp()").scalar_one()
    older = (
        "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database() "
        "AND pid <> pg_backend_pid() AND backend_xmin IS NOT NULL AND xact_start <= %s"
    )
    until = time.monotonic() + WAIT_MS / 1000
    while c.exec_driver_sql(older, (began,)).scalar_one():
        if time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True
