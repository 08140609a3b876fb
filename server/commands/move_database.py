"""`sagittal move-database`: move the database from the data folder to PostgreSQL."""

from __future__ import annotations

import sys
from contextlib import closing

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import load_settings


def move_database(*, data_dir: DataDir = None) -> int:
    """Copy every row to SAGITTAL_DATABASE_URL and retire the file; 1 if not possible."""
    from sagittal.server import audit
    from sagittal.server.storage import fs
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.migrate import MigrationError, copy_database, require_current

    settings = load_settings({"data_dir": data_dir})
    aside = settings.backups / "before-postgresql.db"
    try:
        if not settings.database_url:
            raise MigrationError("Set SAGITTAL_DATABASE_URL to the empty PostgreSQL database first.")
        if not settings.database.exists():
            raise MigrationError(f"There is no {settings.database}; give the folder with --data.")
        if aside.exists():
            raise MigrationError(f"{aside} exists already; put it elsewhere first.")
        holder = "a move to PostgreSQL"
        with fs.Lock(settings.lock, holder), fs.Lock(settings.workers_lock, holder):
            require_current(settings.database)
            copy_database(settings.database, settings.database_source)
            with closing(Database(settings.database_source)) as db, db.read() as c:
                wrong = db.problems() + audit.find_problems(c)
            if wrong:
                raise MigrationError(f"The copy is not whole ({wrong[0]}); {settings.database} stays.")
            with closing(Database(settings.database)) as old:
                old.fold()
            fs.make_folder(settings.backups)
            fs.move_file(settings.database, aside)
            fs.sync_folder(settings.data_dir)
    except fs.LockedError as error:
        sys.stderr.write(f"{settings.data_dir} is in use by {error.holder}; stop it first.\n")
        return 1
    except MigrationError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(f"The database is in PostgreSQL now; the old file is {aside}.\n")
    sys.stdout.flush()
    return 0
