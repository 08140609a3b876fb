"""Putting a backup back: into an empty data folder, everything checked before anything is in its place.

    restored = restore(archive, settings, key)            # settings.data_dir: empty or not there
    restored = try_restore(archive, settings, key)       # the same into a folder that is removed again

All of it is written into `restoring/` of that folder and verified there: every hash, the database by SQLite's
own checks, the audit chain, every file that a row refers to. Who was erased since is erased again. Then four
renames, the database last (into PostgreSQL its rows, in one transaction): without it no server starts on the
folder, and a restore that was killed is simply made again.
"""

from __future__ import annotations

import datetime as dt
import re
import shutil
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from sqlalchemy import delete, select, update

from core.formats.json_tree import read_json
from server import audit
from server.services import checks, erasure, patients
from server.services.backups import DATABASE, FORMAT, MANIFEST, count_patients_and_sessions
from server.services.reviewed import ReviewedAnalyses
from server.services.tombstones import NAME as TOMBSTONES
from server.services.tombstones import Tombstones, parse_tombstones, read_tombstones
from server.settings import Settings
from server.storage import fs
from server.storage.archive import PIECE, ArchivedFile, ClinicKey, read_archive
from server.storage.blobs import BlobStore
from server.storage.db import Database
from server.storage.high_water import HighWater, read_newest, set_mark
from server.storage.migrate import MigrationError, copy_database, exists, require_current, upgrade
from server.storage.person_tables import api_token
from server.storage.report_tables import report_link
from server.storage.tables import login_session, now, one_time_token, patient, session

RESTORED: Final = "backup.restored"
_OURS: Final = re.compile(
    r"blobs/[0-9a-f]{32}/[0-9a-f]{64}|live/[0-9a-f]{32}\.(log|\d+\.damaged)"
    r"|second-factor\.key"
)
_MOST_MANIFEST: Final = 500_000_000
_MAY_BE_THERE: Final = {"lost+found", "cache", "server.lock"}
"""What an empty data folder may hold."""
_MARGIN: Final = 1.1
"""Room that a restore needs, as a part of the archive."""


class RestoreError(Exception):
    """Nothing was put in place; the message says why and what to do."""


@dataclass(frozen=True)
class BackupManifest:
    """What a backup says of itself.

    Parameters
    ----------
    files : (name, bytes, sha256) of everything in it. missing : files that were gone when it was made.
    erased : who had been erased by then. patients, sessions : how many rows.
    """

    created_at: dt.datetime
    files: frozenset[tuple[str, int, str]]
    missing: frozenset[tuple[str, str]]
    erased: Tombstones
    audit_head: HighWater | None
    patients: int
    sessions: int


@dataclass(frozen=True)
class RestoredClinic:
    """What was put back.

    Parameters
    ----------
    created_at : when the backup was made. patients, sessions : how many are there now.
    files : stored files and live logs. erased_again : patients and sessions that had been erased since.
    missing : files that the backup itself said were gone.
    """

    created_at: dt.datetime
    patients: int
    sessions: int
    files: int
    erased_again: int
    missing: int


def restore(
    archive: Path, settings: Settings, key: ClinicKey | None, erased: Tombstones | None = None
) -> RestoredClinic:
    """Put a backup into the empty folder `settings.data_dir`.

    Parameters
    ----------
    erased : who must not come back, besides those that the backup and `erased.json` beside it name.

    Raises
    ------
    RestoreError, BackupFileError, TombstoneError
        the folder is in use or holds something, the backup is damaged, cut, encrypted or of a newer version.
    """
    if not archive.is_file():
        raise RestoreError(f"There is no file {archive}.")
    gone = read_tombstones(archive.parent / TOMBSTONES) | (erased or Tombstones())
    try:
        fs.make_folder(settings.data_dir)
        lock = fs.Lock(settings.lock, "a restore")
        try:
            return _restore(archive, settings, key, gone)
        finally:
            lock.release()
    except fs.LockedError as error:
        raise RestoreError(f"{settings.data_dir} is in use by {error.holder}; stop it first.") from error
    except MigrationError as error:
        raise RestoreError(str(error)) from error
    except OSError as error:
        raise RestoreError(
            f"{settings.data_dir} could not be written ({error.strerror or error}); nothing was put in place."
        ) from error


def try_restore(archive: Path, settings: Settings, key: ClinicKey | None) -> RestoredClinic:
    """Restore a backup of this clinic beside it, and remove it again; raises as `restore` does."""
    home = settings.backups / "restore-test"
    fs.remove_tree(home)
    try:
        return restore(archive, replace(settings, data_dir=home, database_url=""), key)
    finally:
        fs.remove_tree(home)


def _restore(archive: Path, settings: Settings, key: ClinicKey | None, gone: Tombstones) -> RestoredClinic:
    _require_empty(settings)
    _require_room(archive, settings.data_dir)
    stage = replace(settings, data_dir=settings.restoring, database_url="")
    fs.make_folder(stage.data_dir)
    try:
        restored = _prepare(archive, stage, key, gone)
    except BaseException:
        fs.remove_tree(stage.data_dir)
        raise
    _put_in_place(settings, stage)
    return restored


def _require_empty(settings: Settings) -> None:
    """Remove what a killed restore left; raise RestoreError when anything else is here."""
    stage = settings.restoring
    if stage.exists() and not _has_database(settings):
        if _placing(stage).exists():
            # the folder was empty when this was written, so these are the restore's own
            for folder in (settings.blobs, settings.live):
                fs.remove_tree(folder)
            for path in (settings.mark, settings.second_factor_key):
                fs.remove_file(path)
            fs.sync_folder(settings.data_dir)
        fs.remove_tree(stage)
    found = sorted(path.name for path in settings.data_dir.iterdir() if path.name not in _MAY_BE_THERE)
    if _has_database(settings) and settings.database_url:
        raise RestoreError(
            "The PostgreSQL database holds a clinic already; nothing was changed. Make an empty one and set "
            "SAGITTAL_DATABASE_URL to it."
        )
    if found:
        raise RestoreError(
            f"{settings.data_dir} is not empty ({', '.join(found[:5])}). Restore into an empty folder; move "
            "the old one aside first, and keep it."
        )


def _has_database(settings: Settings) -> bool:
    """Whether a clinic is in it already: a file, or rows on the server; tables of another version are one."""
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


def _require_room(archive: Path, folder: Path) -> None:
    needed, free = int(archive.stat().st_size * _MARGIN), shutil.disk_usage(folder).free
    if free < needed:
        raise RestoreError(f"A restore needs {needed} bytes in {folder}; {free} are free. Make room first.")


def _prepare(archive: Path, stage: Settings, key: ClinicKey | None, gone: Tombstones) -> RestoredClinic:
    """Write and verify everything in the stage, and erase again who was erased."""
    manifest = _extract(archive, stage, key)
    upgrade(stage.database)
    fs.remove_tree(stage.backups)  # the copy that the upgrade made
    blobs = BlobStore(stage.blobs)
    fs.make_folder(stage.live)
    with closing(Database(stage.database)) as db:
        with db.read() as c:
            head, counted = read_newest(c), count_patients_and_sessions(c)
        if head != manifest.audit_head or counted != (manifest.patients, manifest.sessions):
            raise RestoreError(f"{archive.name}: its database is not the one that its manifest describes.")
        defects = [
            defect
            for defect in checks.check(db, blobs, stage, known_missing=manifest.missing)
            if defect.area in {"database", "files", "audit"}
        ]
        if defects:
            raise RestoreError(f"{archive.name}: {defects[0].area}: {defects[0].message}")
        again = _erase_again(db, blobs, stage, gone | manifest.erased)
        with db.write() as c:
            # who had signed in then has not signed in here; what was revoked since must not work again
            c.execute(delete(login_session))
            c.execute(delete(api_token))
            c.execute(delete(one_time_token))
            c.execute(update(report_link).where(report_link.c.revoked_at.is_(None)).values(revoked_at=now()))
            detail = {"created_at": manifest.created_at.isoformat(), "erased_again": again}
            audit.record(c, None, RESTORED, "database", None, detail)
        with db.read() as c:
            people, visits = count_patients_and_sessions(c)
        set_mark(db, stage.mark)
    fs.sync_file(stage.database)
    files = sum(1 for _ in blobs.files()) + sum(1 for _ in stage.live.iterdir())
    return RestoredClinic(manifest.created_at, people, visits, files, again, len(manifest.missing))


def _extract(archive: Path, stage: Settings, key: ClinicKey | None) -> BackupManifest:
    """Write every file of the archive and compare them with its manifest, which comes last."""
    found: set[tuple[str, int, str]] = set()
    manifest: BackupManifest | None = None
    with closing(read_archive(archive, key)) as members:
        for name, size, content in members:
            if manifest is not None:
                raise RestoreError(f"{archive.name} goes on behind its end; it is not as it was made.")
            if name == MANIFEST:
                if size > _MOST_MANIFEST:
                    raise RestoreError(f"{archive.name}: a manifest of {size} bytes is none of ours.")
                manifest = _read_manifest(archive, content.read(size))
            elif name == DATABASE or _OURS.fullmatch(name):
                found.add((name, size, _write(stage.data_dir / name, content)))
            else:
                raise RestoreError(f"{archive.name} holds '{name[:80]}', which no backup does.")
    if manifest is None:
        raise RestoreError(f"{archive.name} is damaged or was cut: it has no manifest. Use another backup.")
    if found != manifest.files:
        wrong = sorted(one[0] for one in found ^ manifest.files)
        raise RestoreError(
            f"{archive.name} is damaged: {wrong[0]} is not what was stored. Use another backup."
        )
    return manifest


def _write(path: Path, content: ArchivedFile) -> str:
    fs.make_folder(path.parent)
    with fs.IncomingFile(path.parent) as file:
        while piece := content.read(PIECE):
            file.write(piece)
        file.keep(path)
    return file.sha256


def _read_manifest(archive: Path, data: bytes) -> BackupManifest:
    try:
        tree: Any = read_json(data)
        version = tree["format"]
        if version != FORMAT:
            raise RestoreError(
                f"{archive.name} has format {version}, this version of Sagittal reads {FORMAT}. Install the "
                f"one that made it ({tree.get('code_version')})."
            )
        head = tree["audit_head"]
        return BackupManifest(
            dt.datetime.fromisoformat(tree["created_at"]),
            frozenset((str(n), int(size), str(sha256)) for n, size, sha256 in tree["files"]),
            frozenset((str(space), str(sha256)) for space, sha256 in tree["missing"]),
            parse_tombstones(tree["erased"]),
            None if head is None else HighWater(head["seq"], head["hash"]),
            int(tree["patients"]),
            int(tree["sessions"]),
        )
    except (ValueError, KeyError, TypeError) as error:
        raise RestoreError(f"{archive.name}: its manifest cannot be read ({error}).") from error


def _erase_again(db: Database, blobs: BlobStore, stage: Settings, gone: Tombstones) -> int:
    """Erase who is on the list and came back; return how many patients and sessions."""
    with db.read() as c:
        visits = c.execute(select(session.c.id).where(session.c.id.in_(gone.sessions))).scalars().all()
        people = c.execute(select(patient.c.id).where(patient.c.id.in_(gone.patients))).scalars().all()
    reviewed = ReviewedAnalyses(blobs)
    for one in visits:
        erasure.erase_session(db, reviewed, stage, None, one)
    for one in people:
        with db.read() as c:
            code = patients.get(c, one).code
        erasure.erase_patient(db, reviewed, stage, None, one, confirm=code)
    return len(visits) + len(people)


def _placing(stage: Path) -> Path:
    """The file that says that the renames have begun."""
    return stage / "placing"


def _put_in_place(settings: Settings, stage: Settings) -> None:
    fs.write_file(_placing(stage.data_dir), b"")
    for source, target in (
        (stage.blobs, settings.blobs),
        (stage.live, settings.live),
        (stage.mark, settings.mark),
        (stage.second_factor_key, settings.second_factor_key),
        *(() if settings.database_url else ((stage.database, settings.database),)),
    ):
        if source.exists():
            fs.move_file(source, target)
            fs.sync_folder(settings.data_dir)
    if settings.database_url:
        copy_database(stage.database, settings.database_source)
    fs.remove_tree(stage.data_dir)
