"""Target of a restore: an empty data folder with an empty database and bucket.

Remains of a killed restore, or of a server that failed to start, are removed.
"""

from __future__ import annotations

import re
import shutil
from contextlib import closing
from pathlib import Path
from typing import Final

from sagittal.server.safekeeping.backups import IDENTITY_KEY, count_patients_and_sessions
from sagittal.server.settings import Settings
from sagittal.server.storage import fs
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_bucket import BucketBlobs
from sagittal.server.storage.high_water import read_newest
from sagittal.server.storage.migrate import MigrationError, exists, require_current

_MAY_BE_THERE: Final = {"lost+found", "cache", "server.lock", "workers.lock", "part-locks"}
"""Permitted content of an empty data folder."""
_OF_A_START: Final = re.compile(
    r"(backups|blobs(/incoming)?|nodes|nodes/[^/]+)/|nodes/(key(\.lock)?|[^/]+/server\.lock)"
)
"""Folders (with a slash) and files left by a restore test or a failed start."""
_MARGIN: Final = 1.1
"""Space required by a restore, relative to the archive."""


class RestoreError(Exception):
    """Nothing was restored; the message gives reason and remedy."""


def make_empty(settings: Settings) -> None:
    """Remove the remains of a killed restore; raise RestoreError if there is anything else.

    The bucket it had begun to fill remains recorded until a restore succeeds.
    """
    stage = settings.restoring
    placing = ""
    if stage.exists() and not _has_database(settings):
        if name_placing(stage).exists():
            placing = _read_placing(stage)
            # the folder was empty when this was written, so these files belong to the restore
            for folder in (settings.blobs, settings.live):
                fs.remove_tree(folder)
            for path in (settings.mark, settings.second_factor_key, settings.data_dir / IDENTITY_KEY):
                fs.remove_file(path)
            fs.sync_folder(settings.data_dir)
        clear_stage(stage)
    names = _find_others(settings)
    if _has_database(settings) and settings.database_url:
        raise RestoreError(
            "The PostgreSQL database holds a clinic already; nothing was changed. Make an empty one and set "
            "SAGITTAL_DATABASE_URL to it."
        )
    if names:
        raise RestoreError(
            f"{settings.data_dir} is not empty ({', '.join(names[:5])}). Restore into an empty folder; move "
            "the old one aside first, and keep it."
        )
    fs.remove_tree(settings.blobs)  # it contains no file
    # the bucket was empty when a killed restore began to fill it: the same files are uploaded again
    if settings.bucket and placing != settings.bucket:
        _require_empty_bucket(settings)


def _find_others(settings: Settings) -> list[str]:
    """Names of files that do not belong in an empty data folder."""

    def is_of_a_start(path: Path) -> bool:
        way = path.relative_to(settings.data_dir).as_posix() + ("/" if path.is_dir() else "")
        return not path.is_symlink() and _OF_A_START.fullmatch(way) is not None

    return sorted(
        path.name
        for path in settings.data_dir.iterdir()
        if path.name not in _MAY_BE_THERE
        and not (path == settings.restoring and _read_placing(path))
        and not (is_of_a_start(path) and all(map(is_of_a_start, path.rglob("*"))))
    )


def _require_empty_bucket(settings: Settings) -> None:
    try:
        is_empty = open_empty_bucket(settings).is_empty()
    finally:
        clear_stage(settings.restoring)
    if not is_empty:
        raise RestoreError(
            f"{settings.bucket} is not empty. Restore into a prefix in which nothing is; one prefix is for "
            "one clinic."
        )


def _has_database(settings: Settings) -> bool:
    """Whether a database exists: a file, or rows on the server; tables of another version count."""
    if not settings.database_url:
        return settings.database.exists()
    if not exists(settings.database_source):
        return False
    try:
        require_current(settings.database_source)
    except MigrationError:
        return True
    with closing(Database(settings.database_source)) as db, db.read() as c:
        return read_newest(c) is not None or count_patients_and_sessions(c) != (0, 0)


def require_room(archive: Path, folder: Path) -> None:
    """Raise RestoreError if the disk has too little space for the content of the archive."""
    needed, free = int(archive.stat().st_size * _MARGIN), shutil.disk_usage(folder).free
    if free < needed:
        raise RestoreError(f"A restore needs {needed} bytes in {folder}; {free} are free. Make room first.")


def name_placing(stage: Path) -> Path:
    """Path of the file that marks the start of the renames."""
    return stage / "placing"


def _read_placing(stage: Path) -> str:
    """The bucket that a killed restore began to fill, "" = none."""
    try:
        return name_placing(stage).read_text("utf-8")
    except FileNotFoundError:
        return ""


def clear_stage(stage: Path) -> None:
    """Remove the staging folder, but keep the record of a partly filled bucket for the next restore."""
    if not _read_placing(stage):
        fs.remove_tree(stage)
        return
    for path in stage.iterdir():
        if path.is_dir() and not path.is_symlink():
            fs.remove_tree(path)
        elif path != name_placing(stage):
            fs.remove_file(path)
    fs.sync_folder(stage)


def open_empty_bucket(settings: Settings) -> BucketBlobs:
    """Open the bucket to be filled by a restore; files in transit are in the staging folder."""
    return BucketBlobs(settings.bucket, settings.restoring / "incoming")
