"""`sagittal trash`: stored files that nothing refers to; put back those that the database knows again."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

from server.settings import load_settings


def trash(data_dir: Path | None, restore: bool) -> int:
    """List the trash, or put back what the database refers to; 1 when the database cannot be used."""
    from server.services import sweep
    from server.storage.blobs import BlobStore
    from server.storage.db import Database
    from server.storage.migrate import MigrationError, require_current
    from server.storage.trash import Trash

    settings = load_settings({"data_dir": data_dir})
    if not restore:
        files = list(Trash(settings.trash).files())
        for one in files:
            sys.stdout.write(
                f"{one.since:%Y-%m-%d %H:%M}Z, until {one.until:%Y-%m-%d}: {one.size} bytes, {one.path}\n"
            )
        sys.stdout.write(f"{len(files)} files in {settings.trash}\n")
        sys.stdout.flush()
        return 0
    try:
        require_current(settings.database_source)
    except MigrationError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    with closing(Database(settings.database_source)) as db:
        back = sweep.put_back(db, BlobStore(settings.blobs), settings)
    sys.stdout.write(f"{back} files that the database refers to are back in {settings.blobs}\n")
    sys.stdout.flush()
    return 0
