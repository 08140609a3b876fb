"""`sagittal trash`: list unreferenced stored files, or restore those referenced again."""

from __future__ import annotations

import sys
from contextlib import closing

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import load_settings


def trash(*, restore: bool = False, data_dir: DataDir = None) -> int:
    """List the trash, or restore referenced files; 1 if the database cannot be used.

    Parameters
    ----------
    restore
        restore files that the database refers to
    """
    from sagittal.server.safekeeping import sweep
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.files.blob_opening import open_blobs
    from sagittal.server.storage.migrate import MigrationError, require_current, require_database

    settings = load_settings({"data_dir": data_dir})
    if not restore:
        try:
            if not (settings.bucket or settings.blobs.is_dir()):  # opening would create the folder
                require_database(settings.database_source)
            discarded = open_blobs(settings).trash
            files = list(discarded.files())
            if not files:  # files of a lost database are listed without it
                require_database(settings.database_source)
        except MigrationError as error:
            sys.stderr.write(f"{error}\n")
            return 1
        for one in files:
            sys.stdout.write(
                f"{one.since:%Y-%m-%d %H:%M}Z, until {one.until:%Y-%m-%d}: {one.size} bytes, "
                f"{discarded.place}/{one.way}\n"
            )
        sys.stdout.write(f"{len(files)} files in {discarded.place}\n")
        sys.stdout.flush()
        return 0
    try:
        require_current(settings.database_source)
    except MigrationError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    with closing(Database(settings.database_source)) as db:
        blobs = open_blobs(settings)
        back = sweep.put_back(db, blobs)
    sys.stdout.write(f"{back} files that the database refers to are back in {blobs.place}\n")
    sys.stdout.flush()
    return 0
