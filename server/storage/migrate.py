"""Migrate a database to the schema of this version; unknown schemas are rejected.

    upgrade(settings.database_source)       # at start of the server and by `sagittal migrate`
await_current(settings.database_source, stop)   # in a worker: waits until a server has migrated
copy_database(source, target)               # a backup's file, or the other engine
"""

from __future__ import annotations

import contextlib
import io
import logging
import threading
import time
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy.exc import DatabaseError, OperationalError

from sagittal import server
from sagittal.server.storage import fs
from sagittal.server.storage.copying import copy_rows
from sagittal.server.storage.db import Source, engine_of
from sagittal.server.storage.postgres import PostgresServer
from sagittal.server.storage.refusal import refusal_of
from sagittal.server.storage.sqlite_file import SqliteFile

log = logging.getLogger(__name__)

WAIT_S = 1.0
"""Interval of checks for the schema."""

INSTALLED = Path(server.__file__).parent / "migrations"
SOURCE = Path(server.__file__).resolve().parents[1] / "migrations"


NO_DRIVER = (
    "PostgreSQL needs the libraries psycopg and procrastinate, which are not installed. Install Sagittal "
    "with its extra: pip install '.[postgres]'."
)


_OTHERS_SERVE = (
    "The database is to be changed for this version, and web servers are running on it. Stop all of them, "
    "then start this version. Nothing was changed."
)
_OTHERS_WORK = (
    "The database is to be changed for this version, and other programs of Sagittal work on it, workers "
    "perhaps (at {}). Stop them, then start this version. Nothing was changed."
)
OTHERS_LEAVE_S = 5.0
"""How long a migration waits for other programs, which may only have checked, to disconnect."""
_OTHER_MIGRATES = "Another program is changing the database for its version. Start again when it is done."


class MigrationError(RuntimeError):
    """The database is incompatible with this version or unreachable; the message contains a remedy."""


class NotMigratedError(MigrationError):
    """The database has no schema yet, or an older one; starting a server or `migrate` upgrades it."""


def configuration(database: Source, scripts: Path | None = None) -> Config:
    """Alembic configuration for a database; the scripts are in the wheel or the source tree."""
    config = Config(stdout=io.StringIO())
    config.set_main_option("path_separator", "os")
    folder = scripts or (INSTALLED if INSTALLED.is_dir() else SOURCE)
    config.set_main_option("script_location", str(folder).replace("%", "%%"))
    config.attributes["database"] = database
    return config


def read_revision(database: Source) -> str | None:
    """The database's revision; None if it does not exist or is empty; raises MigrationError."""
    if isinstance(database, Path) and not database.exists():
        return None
    try:
        kind = engine_of(database)
        engine = kind.reader()
    except ModuleNotFoundError as error:
        raise MigrationError(NO_DRIVER) from error
    try:
        with engine.connect() as connection:
            return MigrationContext.configure(connection).get_current_revision()
    except DatabaseError as error:
        if isinstance(kind, PostgresServer):
            raise MigrationError(kind.explain(error)) from error
        refusal = refusal_of(error)
        if refusal is not None:  # SQLite needs some space even for reading
            raise MigrationError(f"{database} cannot be opened. {refusal.sentence}") from error
        raise MigrationError(
            f"{database} cannot be read as a database ({error.orig}). Restore it from a backup "
            f"({kind.path.parent / 'backups'} holds those made before upgrades)."
        ) from error
    finally:
        engine.dispose()


def exists(database: Source) -> bool:
    """Whether the database exists: a file, or tables on the server; raises MigrationError."""
    return database.exists() if isinstance(database, Path) else read_revision(database) is not None


def require_database(database: Source) -> None:
    """Raise MigrationError if there is no database, so that commands do not create one in a wrong folder."""
    if exists(database):
        return
    if isinstance(database, Path):
        raise MigrationError(f"There is no database in {database.parent}; give the folder with --data.")
    raise NotMigratedError(
        "The database that SAGITTAL_DATABASE_URL names has no clinic. Check its name, or start the server."
    )


def upgrade(
    database: Source, *, target: str = "head", scripts: Path | None = None, backups: Path | None = None
) -> Path | None:
    """Migrate in one transaction and return the backup made before (None: no data existed).

    Parameters
    ----------
    backups : folder of the backup, None = next to a file; required on PostgreSQL if it contains data.

    Raises
    ------
    MigrationError
        the database belongs to an unknown version, or web servers or workers are using it.
    """
    config = configuration(database, scripts)
    if isinstance(database, Path):
        fs.make_folder(database.parent)
        _keep_private(database)
        backups = backups or database.parent / "backups"
    revision = _known(config, database)
    target_revision = ScriptDirectory.from_config(config).as_revision_number(target)
    if isinstance(database, Path):
        return None if revision == target_revision else _change(config, database, target, backups, scripts)
    if revision == target_revision and _has_delivery(database):
        return None
    server = PostgresServer(database)
    with contextlib.ExitStack() as held:
        try:
            held.enter_context(server.take_turn_to_migrate())
        except OperationalError as error:
            raise MigrationError(_OTHER_MIGRATES) from error
        if _known(config, database) == target_revision and _has_delivery(database):
            return None  # the previous holder of the lock has done it
        if not held.enter_context(server.serve("")):
            raise MigrationError(_OTHERS_SERVE)
        if _known(config, database) is not None:
            _await_being_alone(server)
        backup = _change(config, database, target, backups, scripts)
        _prepare_delivery(server)
        return backup


def _await_being_alone(server: PostgresServer) -> None:
    until = time.monotonic() + OTHERS_LEAVE_S
    while hosts := server.list_others():
        if time.monotonic() > until:
            raise MigrationError(_OTHERS_WORK.format(", ".join(hosts)))
        time.sleep(0.1)


def _change(
    config: Config, database: Source, target: str, backups: Path | None, scripts: Path | None
) -> Path | None:
    """Migrate after a backup of existing data; return its path."""
    backup, revision = None, _known(config, database)
    if revision is not None and revision != ScriptDirectory.from_config(config).as_revision_number(target):
        if backups is None:
            raise MigrationError("The database is older. Start the server, or run `sagittal migrate`.")
        backup = _backup(database, revision, backups, scripts)
    command.upgrade(config, target)
    return backup


def copy_database(source: Source, target: Source, scripts: Path | None = None) -> None:
    """Write a consistent copy of a database in use to an empty target.

    Raises
    ------
    MigrationError
        `target` is not empty.
    """
    if isinstance(source, Path) and isinstance(target, Path):
        SqliteFile(source).write_copy(target)
        return
    revision = read_revision(source)
    upgrade(target, target=revision or "base", scripts=scripts)
    origin, destination = engine_of(source).reader(), engine_of(target).writer()
    try:
        with origin.begin() as read, destination.begin() as write:
            if not copy_rows(read, write):
                raise MigrationError("The target holds rows already, so nothing was copied. Empty it.")
    finally:
        origin.dispose()
        destination.dispose()


def require_current(database: Source, scripts: Path | None = None) -> None:
    """Raise MigrationError unless a database exists and has exactly this version's schema.

    Raises NotMigratedError if a server of this version has yet to be started.
    """
    require_database(database)
    config = configuration(database, scripts)
    head = ScriptDirectory.from_config(config).get_current_head()
    revision = _known(config, database)
    if revision != head:
        raise NotMigratedError(
            f"The database is at revision {revision}, this version needs {head}. "
            "Start the server or run `sagittal migrate`."
        )
    if isinstance(database, str) and not _has_delivery(database):
        raise NotMigratedError(
            "The database has no tables of this version's procrastinate, by which jobs are delivered. "
            "Start the server or run `sagittal migrate`; install the same version everywhere."
        )


def await_current(database: Source, stop: threading.Event, pause_s: float = WAIT_S) -> None:
    """Wait until the schema is this version's or `stop` is set; logs one line while waiting.

    Raises
    ------
    MigrationError
        waiting is futile: there is no such database, or it belongs to a newer version.
    """
    is_waiting = False
    while not stop.is_set():
        try:
            require_current(database)
        except NotMigratedError as error:
            if not is_waiting:
                log.info("waiting until a server has prepared the database (%s)", error)
            is_waiting = True
            stop.wait(pause_s)
        else:
            return


def _prepare_delivery(server: PostgresServer) -> None:
    try:
        server.prepare_delivery()
    except ModuleNotFoundError as error:
        raise MigrationError(NO_DRIVER) from error
    except DatabaseError as error:
        raise MigrationError(server.explain(error)) from error


def _has_delivery(database: str) -> bool:
    server = PostgresServer(database)
    engine = server.reader()
    try:
        with engine.connect() as c:
            return server.has_delivery(c)
    except ModuleNotFoundError as error:
        raise MigrationError(NO_DRIVER) from error
    finally:
        engine.dispose()


def _known(config: Config, database: Source) -> str | None:
    revision = read_revision(database)
    revisions = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    if revision is not None and revision not in revisions:
        raise MigrationError(
            f"The database is at revision {revision}, which this version of Sagittal does not know: a newer "
            "one wrote it. Install that version again, or restore the backup made before the upgrade."
        )
    return revision


def _keep_private(database: Path) -> None:
    """Restrict the file to its owner, also in a shared folder; SQLite applies the umask."""
    logs = [database.with_name(database.name + end) for end in ("-wal", "-shm")]
    for path in (database, *(log for log in logs if log.exists())):
        with contextlib.suppress(PermissionError):  # owned by another user, who decides
            fs.keep_private(path)


def _backup(database: Source, revision: str, folder: Path, scripts: Path | None) -> Path:
    fs.make_folder(folder)
    target = folder / f"{revision}-{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}-{time.monotonic_ns()}.db"
    fs.keep_private(target)
    copy_database(database, target, scripts)
    fs.sync_file(target)
    return target
