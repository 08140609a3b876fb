"""`sagittal migrate`: upgrade the database to the schema of this version."""

from __future__ import annotations

import sys

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import load_settings


def migrate(*, data_dir: DataDir = None) -> int:
    """Upgrade the database in one transaction, after a backup; 1 if it belongs to a newer version."""
    from sagittal.server.storage.migrate import MigrationError, require_database, upgrade

    settings = load_settings({"data_dir": data_dir})
    try:
        require_database(settings.database_source)
        backup = upgrade(settings.database_source, backups=settings.backups)
    except MigrationError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write("The database is current." + (f" Backup: {backup}" if backup else "") + "\n")
    sys.stdout.flush()
    return 0
