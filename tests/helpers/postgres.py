"""A PostgreSQL server for tests: started by the first one that needs it, on loopback, stopped at the end.

It refuses to run as root, so root starts it as another user. Nothing waits for a disk.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import itertools
import os
import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from sagittal.server.storage.migrate import upgrade

USERS: Final = ("postgres", "nobody")
"""Whom root starts it as: the first there is."""
PASSWORD: Final = "of the tests"
OPTIONS: Final = (
    "fsync=off",
    "full_page_writes=off",
    # with hundreds of databases its workers come several times a second; none of them lives long enough
    "autovacuum=off",
    "unix_socket_directories=",
    "listen_addresses=127.0.0.1",
    "max_connections=200",
)
_numbers = itertools.count()


class NoPostgresError(Exception):
    """PostgreSQL is not installed; the message gives the reason."""


@functools.cache
def find_programs() -> Path:
    """The folder of initdb and postgres; raises NoPostgresError."""
    named = shutil.which("initdb")
    folders = [Path(named).resolve().parent] if named else []
    folders += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    for folder in folders:
        if all((folder / name).exists() for name in ("initdb", "postgres")):
            return folder
    raise NoPostgresError("PostgreSQL's initdb is not installed")


@functools.cache
def start_server() -> str:
    """The URL of the server's first database; raises NoPostgresError."""
    try:
        import psycopg  # noqa: F401
    except ModuleNotFoundError as error:
        raise NoPostgresError("psycopg is not installed (extra postgres)") from error

    programs = find_programs()
    folder = Path(tempfile.mkdtemp(prefix="sagittal-postgres-"))
    runs_as = _choose_user(folder)
    secret = folder / "password"
    secret.write_text(PASSWORD)
    secret.chmod(0o644)  # in a folder that is closed to others
    data = folder / "data"
    make: list[str | Path] = [
        programs / "initdb",
        "-D",
        data,
        "-U",
        "sagittal",
        "-A",
        "scram-sha-256",
        f"--pwfile={secret}",
    ]
    subprocess.run(
        [*make, "-E", "UTF8", "--locale=C", "--no-sync", "--no-instructions"],
        check=True, capture_output=True, cwd=folder, **runs_as,
    )  # fmt: skip
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    options = [part for option in OPTIONS for part in ("-c", option)]
    command: list[str | Path] = [programs / "postgres", "-D", data, "-p", str(port), *options]
    url = f"postgresql://sagittal:{PASSWORD.replace(' ', '%20')}@127.0.0.1:{port}/postgres"
    server = PostgresProcess(folder, command, runs_as, url)
    _servers[url] = server
    atexit.register(server.remove)
    server.start()
    return url


class PostgresProcess:
    """The server's own process, which a test may stop and start again."""

    def __init__(self, folder: Path, command: list[str | Path], runs_as: dict[str, Any], url: str) -> None:
        self._folder, self._command, self._runs_as, self._url = folder, command, runs_as, url
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it and wait until it answers; raises NoPostgresError."""
        import psycopg

        with (self._folder / "log").open("ab") as log:
            self._process = subprocess.Popen(
                self._command, stdout=log, stderr=log, cwd=self._folder, **self._runs_as
            )
        until = time.monotonic() + 60
        while True:
            try:
                psycopg.connect(self._url).close()
            except psycopg.OperationalError as error:
                if self._process.poll() is not None or time.monotonic() > until:
                    raise NoPostgresError((self._folder / "log").read_text()) from error
                time.sleep(0.05)
            else:
                return

    def stop(self) -> None:
        """Stop it like an administrator's restart, aborting open transactions."""
        if self._process is None:
            return
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(30)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def remove(self) -> None:
        """Stop it for good."""
        self.stop()
        shutil.rmtree(self._folder, ignore_errors=True)


_servers: dict[str, PostgresProcess] = {}


@contextlib.contextmanager
def stopped_server() -> Iterator[None]:
    """While the block runs PostgreSQL is away; afterwards it answers again at its address."""
    server = _servers[start_server()]
    server.stop()
    try:
        yield
    finally:
        server.start()


def give_to_server(folder: Path) -> None:
    """Let the server write into a folder."""
    _choose_user(folder)


def run_sql(statement: str, url: str | None = None) -> list[Any]:
    """Run one statement outside a transaction, in the server's first database if no other is named."""
    import psycopg

    with psycopg.connect(url or start_server(), autocommit=True) as connection:
        cursor = connection.execute(statement.encode())
        return cursor.fetchall() if cursor.description else []


@contextlib.contextmanager
def make_database(*, migrated: bool = True) -> Iterator[str]:
    """Temporary database: empty, or the migrated one without rows.

    Emptying the migrated one costs a tenth of creating another; tests that change its tables use a new one.
    """
    if migrated:
        url = _migrate_one()
        try:
            yield url
        finally:
            run_sql(_EMPTY, url)
        return
    name = f"test_{next(_numbers)}"
    run_sql(f"CREATE DATABASE {name} TEMPLATE template0")
    try:
        yield _url_of(name)
    finally:
        run_sql(f"DROP DATABASE {name} WITH (FORCE)")


def make_lasting_database(*, migrated: bool = True) -> str:
    """A database without rows, or without tables, that stays until the server ends."""
    if migrated:
        _migrate_one()
    name = f"lasting_{next(_numbers)}"
    run_sql(f"CREATE DATABASE {name} TEMPLATE {'migrated' if migrated else 'template0'}")
    return _url_of(name)


_EMPTY: Final = """DO $$
DECLARE one text;
BEGIN
    PERFORM pg_terminate_backend(pid) FROM pg_stat_activity
        WHERE datname = current_database() AND pid <> pg_backend_pid();
    SET LOCAL session_replication_role = replica;  -- without triggers and references
    FOR one IN
        SELECT format('%I.%I', schemaname, tablename) FROM pg_tables
        WHERE schemaname IN ('public', 'procrastinate') AND tablename <> 'alembic_version'
    LOOP
        EXECUTE 'DELETE FROM ' || one;
    END LOOP;
    PERFORM setval(sequencename::regclass, 1, false) FROM pg_sequences WHERE schemaname = 'public';
END $$"""


@functools.cache
def _migrate_one() -> str:
    run_sql("CREATE DATABASE migrated")
    upgrade(_url_of("migrated"))
    return _url_of("migrated")


def _url_of(name: str) -> str:
    return start_server().rpartition("/")[0] + f"/{name}"


def _choose_user(folder: Path) -> dict[str, Any]:
    if os.geteuid() != 0:
        return {}
    for name in USERS:
        with contextlib.suppress(KeyError):
            getpwnam = pwd.getpwnam(name)
            os.chown(folder, getpwnam.pw_uid, getpwnam.pw_gid)
            return {"user": getpwnam.pw_uid, "group": getpwnam.pw_gid, "extra_groups": []}
    raise NoPostgresError(f"PostgreSQL does not run as root, and there is no user {' or '.join(USERS)}")
