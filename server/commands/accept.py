"""`sagittal accept`: trust this database although it was emptied, restored or replaced."""

from __future__ import annotations

import sys
from contextlib import closing

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import load_settings


def accept(*, data_dir: DataDir = None) -> int:
    """Trust the database from now on; 1 if it cannot be used."""
    from sagittal.server.safekeeping import custody
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.files.blob_opening import open_blobs
    from sagittal.server.storage.migrate import MigrationError, require_database, upgrade

    settings = load_settings({"data_dir": data_dir})
    try:
        try:
            custody.refuse_strangers(settings)
        except custody.StrangersError:
            pass  # a new start, independent of an earlier database
        else:
            require_database(settings.database_source)
        upgrade(settings.database_source, backups=settings.backups)
    except MigrationError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    with closing(Database(settings.database_source)) as db:
        doubted = custody.accept(db, settings)
    if doubted is None:
        sys.stdout.write("There was no doubt about this database; nothing is changed.\n")
    else:
        sys.stdout.write(
            f"{doubted}\nIt is the right one from now on. Stored files that it does not know go to "
            f"{open_blobs(settings).trash.place} and stay 30 days; live logs stay in {settings.live}.\n"
        )
    sys.stdout.flush()
    return 0
