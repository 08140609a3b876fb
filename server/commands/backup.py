"""`sagittal backup`: back up everything into one file while the service runs."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import load_settings


def backup(
    target: Annotated[Path, Parameter(metavar="DIR|FILE")],
    /,
    *,
    key: Path | None = None,
    prune: bool = False,
    data_dir: DataDir = None,
) -> int:
    """Create one backup; 1 on failure, or if a stored file was already missing or damaged.

    Parameters
    ----------
    target
        a folder of backups, or the file to write
    key
        encrypt it (`sagittal keygen`)
    prune
        then retain 7 daily, 4 weekly and 12 monthly backups in that folder
    """
    from sagittal.server.safekeeping import backups
    from sagittal.server.safekeeping.tombstones import TombstoneError
    from sagittal.server.storage.archive import BackupFileError, read_key
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.migrate import MigrationError, require_current

    settings = load_settings({"data_dir": data_dir})
    try:
        require_current(settings.database_source)
        clinic_key = None if key is None else read_key(key)
        with closing(Database(settings.database_source)) as db:
            result = backups.make_backup(db, settings, target.absolute(), clinic_key)
        gone = backups.prune(result.path.parent) if prune else []
    except (BackupFileError, TombstoneError, backups.BackupError, MigrationError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    head = "none" if result.head is None else f"{result.head.seq}:{result.head.hash}"
    sys.stdout.write(f"{result.path}: {result.files} files, {result.size} bytes, audit head {head}\n")
    if result.left_out is not None:
        sys.stdout.write(
            f"The key of patients' names, {result.left_out}, is not in it: it is not encrypted (--key), or "
            "the key cannot be read. Keep a copy of the key elsewhere.\n"
        )
    for path in gone:
        sys.stdout.write(f"removed {path}\n")
    sys.stdout.flush()
    for space, sha256 in result.missing:
        sys.stderr.write(f"patient {space}: {sha256[:12]}… is gone or damaged; see `sagittal check`\n")
    return 1 if result.missing else 0
