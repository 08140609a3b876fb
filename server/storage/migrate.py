"""Bring a database to the schema of this version; never start on one we do not know.

    upgrade(settings.database)          # at start of the server and by `sagittal migrate`
require_current(settings.database)  # in a worker: refuses instead of migrating
"""

from __future__ import annotations

import contextlib
import io
import time
from contextlib import closing
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy.exc import DatabaseError

import server
from server.storage import fs
from server.storage.db import Database, migration_engine
from server.storage.refusal import refusal_of

INSTALLED = Path(server.__file__).parent / "migrations"
SOURCE = Path(server.__file__).parent.parent / "migrations"


class MigrationError(RuntimeError):
    """The database's revision is not one this version can work with; the message says what to do."""


def configuration(database: Path, scripts: Path | None = None) -> Config:
    """Alembic's configuration for a database; the scripts lie in the wheel or in the source tree."""
    config = Config(stdout=io.StringIO())
    config.set_main_option("path_separator", "os")
    folder = scripts or (INSTALLED if INSTALLED.is_dir() else SOURCE)
    config.set_main_option("script_location", str(folder).replace("%", "%%"))
    config.attributes["database"] = database
    return config


def read_revision(database: Path) -> str | None:
    """The database's revision; None when there is none yet or it is empty; raises MigrationError."""
    if not database.exists():
        return None
    engine = migration_engine(database)
    try:
        with engine.connect() as connection:
            return MigrationContext.configure(connection).get_current_revision()
    except DatabaseError as error:
        refusal = refusal_of(error)
        if refusal is not None:  # SQLite needs some room even to read
            raise MigrationError(f"{database} cannot be opened. {refusal.sentence}") from error
        raise MigrationError(
            f"{database} cannot be read as a database ({error.orig}). Restore it from a backup "
            f"({database.parent / 'backups'} holds those made before upgrades)."
        ) from error
    finally:
        engine.dispose()


def upgrade(database: Path, *, target: str = "head", scripts: Path | None = None) -> Path | None:
    """Migrate in one transaction and return the backup made before it (None: there was nothing to keep).

    Raises
    ------
    MigrationError
        the database was made by a version that this one does not know.
    """
    config = configuration(database, scripts)
    fs.make_folder(database.parent)
    _keep_private(database)
    at = _known(config, database)
    wanted = ScriptDirectory.from_config(config).as_revision_number(target)
    if at == wanted:
        return None
    backup = _backup(database, at) if at else None
    command.upgrade(config, target)
    return backup


def require_current(database: Path, scripts: Path | None = None) -> None:
    """Raise MigrationError unless the schema is exactly this version's."""
    config = configuration(database, scripts)
    head = ScriptDirectory.from_config(config).get_current_head()
    at = _known(config, database)
    if at != head:
        raise MigrationError(
            f"The database is at revision {at}, this version needs {head}. "
            "Start the server or run `sagittal migrate`."
        )


def _known(config: Config, database: Path) -> str | None:
    at = read_revision(database)
    known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    if at is not None and at not in known:
        raise MigrationError(
            f"The database is at revision {at}, which this version of Sagittal does not know: a newer one "
            "wrote it. Install that version again, or restore the backup made before the upgrade."
        )
    return at


def _keep_private(database: Path) -> None:
    """Let nobody else read it, also in a folder open to everybody; SQLite goes by the umask."""
    logs = [database.with_name(database.name + end) for end in ("-wal", "-shm")]
    for path in (database, *(log for log in logs if log.exists())):
        with contextlib.suppress(PermissionError):  # of another owner, who decides
            fs.keep_private(path)


def _backup(database: Path, revision: str) -> Path:
    folder = database.parent / "backups"
    fs.make_folder(folder)
    target = folder / f"{revision}-{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}-{time.monotonic_ns()}.db"
    fs.keep_private(target)
    with closing(Database(database)) as db:
        db.backup(target)
    fs.sync_file(target)
    return target
