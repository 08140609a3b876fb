"""Restore of a backup into an empty data folder, after verifying everything.

    restored = restore(archive, settings, key)            # settings.data_dir: empty or missing
    restored = try_restore(archive, settings, key)       # into a temporary folder

All of it is written into `restoring/` of that folder and verified there: every hash, the database by SQLite's
own checks, the audit chain, every file that a row refers to. Who was erased since is erased again. Then some
renames, the database last (into PostgreSQL its rows, in one transaction): without it no server starts on the
folder, and a restore that was killed is simply made again. A bucket, whose prefix must be empty, is filled
before the renames.
"""

from __future__ import annotations

import datetime as dt
import re
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from sqlalchemy import delete, select, update

from sagittal.core.formats.json_tree import read_json
from sagittal.server import audit
from sagittal.server.clinic import identities, patients
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.safekeeping import checks, erasure
from sagittal.server.safekeeping.backups import (
    DATABASE,
    FORMAT,
    IDENTITY_KEY,
    MANIFEST,
    count_patients_and_sessions,
)
from sagittal.server.safekeeping.restore_room import (
    RestoreError,
    clear_stage,
    make_empty,
    name_placing,
    open_empty_bucket,
    require_room,
)
from sagittal.server.safekeeping.tombstones import NAME as TOMBSTONES
from sagittal.server.safekeeping.tombstones import Tombstones, parse_tombstones, read_tombstones
from sagittal.server.settings import Settings
from sagittal.server.sharing import care_teams
from sagittal.server.storage import fs
from sagittal.server.storage.archive import PIECE, ArchivedFile, ClinicKey, read_archive
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_folder import FolderBlobs
from sagittal.server.storage.files.blob_opening import write_note
from sagittal.server.storage.files.blobs import BlobStore, StoreAway
from sagittal.server.storage.high_water import HighWater, read_newest, set_mark
from sagittal.server.storage.migrate import MigrationError, copy_database, upgrade
from sagittal.server.storage.schema.live_tables import live_take
from sagittal.server.storage.schema.node_tables import failed_attempt, web_node
from sagittal.server.storage.schema.person_tables import api_token
from sagittal.server.storage.schema.report_tables import report_link
from sagittal.server.storage.schema.tables import login_session, now, one_time_token, patient, session

RESTORED: Final = "backup.restored"
_OURS: Final = re.compile(
    r"blobs/[0-9a-f]{32}/[0-9a-f]{64}|live/[0-9a-f]{32}\.(log|\d+\.damaged)"
    r"|second-factor\.key|identity\.key"
)
_MOST_MANIFEST: Final = 500_000_000


@dataclass(frozen=True)
class BackupManifest:
    """Manifest of a backup.

    Parameters
    ----------
    files : (name, bytes, sha256) of all content. missing : files already missing at the time.
    erased : patients and sessions erased by then. patients, sessions : numbers of rows.
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
    """Summary of a restore.

    Parameters
    ----------
    created_at : time of the backup. patients, sessions : restored numbers.
    files : stored files and live logs. erased_again : patients and sessions erased since the backup.
    missing : files that the backup lists as missing.
    names_open : whether the key in the backup decrypts all identities, or there are none.
    """

    created_at: dt.datetime
    patients: int
    sessions: int
    files: int
    erased_again: int
    missing: int
    names_open: bool


def restore(
    archive: Path, settings: Settings, key: ClinicKey | None, erased: Tombstones | None = None
) -> RestoredClinic:
    """Restore a backup into the empty folder `settings.data_dir`.

    Parameters
    ----------
    erased : patients and sessions to exclude, in addition to those in the backup and in `erased.json` next to
        it.

    Raises
    ------
    RestoreError, BackupFileError, TombstoneError
        the folder is in use or not empty, or the backup is damaged, truncated, encrypted or of a newer
        version.
    """
    if not archive.is_file():
        raise RestoreError(f"There is no file {archive}.")
    settings = replace(settings, node_name="", node_address="")
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
    except StoreAway as error:
        raise RestoreError(
            f"{settings.bucket} cannot be used ({error.detail}). Mend that and restore again."
        ) from error
    except OSError as error:
        raise RestoreError(
            f"{settings.data_dir} could not be written ({error.strerror or error}); nothing was put in place."
        ) from error


def try_restore(archive: Path, settings: Settings, key: ClinicKey | None) -> RestoredClinic:
    """Restore a backup of this clinic into a temporary folder; raises like `restore`."""
    home = settings.backups / "restore-test"
    fs.remove_tree(home)
    try:
        return restore(archive, _at(settings, home), key)
    finally:
        fs.remove_tree(home)


def _restore(archive: Path, settings: Settings, key: ClinicKey | None, gone: Tombstones) -> RestoredClinic:
    make_empty(settings)
    require_room(archive, settings.data_dir)
    stage = _at(settings, settings.restoring)
    fs.make_folder(stage.data_dir)
    try:
        restored = _prepare(archive, stage, key, gone)
    except BaseException:
        clear_stage(stage.data_dir)
        raise
    _put_in_place(settings, stage)
    return restored


def _prepare(archive: Path, stage: Settings, key: ClinicKey | None, gone: Tombstones) -> RestoredClinic:
    """Extract and verify everything in the staging folder, and repeat erasures."""
    manifest = _extract(archive, stage, key)
    upgrade(stage.database)
    fs.remove_tree(stage.backups)  # the copy created by the upgrade
    blobs = FolderBlobs(stage.blobs)
    fs.make_folder(stage.live)
    with closing(Database(stage.database)) as db:
        with db.read() as c:
            head, counts = read_newest(c), count_patients_and_sessions(c)
        if head != manifest.audit_head or counts != (manifest.patients, manifest.sessions):
            raise RestoreError(f"{archive.name}: its database is not the one that its manifest describes.")
        defects = [
            defect
            for defect in checks.check(db, blobs, stage, known_missing=manifest.missing)
            if defect.area in {"database", "files", "audit"}
        ]
        if defects:
            raise RestoreError(f"{archive.name}: {defects[0].area}: {defects[0].message}")
        erased_counts = _erase_again(db, blobs, stage, gone | manifest.erased)
        with db.write() as c:
            # earlier sign-ins are not valid here; later revocations must not be undone
            for table in (login_session, failed_attempt, web_node):
                c.execute(delete(table))
            c.execute(update(live_take).values(node=None, node_run=None))
            c.execute(delete(api_token))
            c.execute(delete(one_time_token))
            c.execute(update(report_link).where(report_link.c.revoked_at.is_(None)).values(revoked_at=now()))
            care_teams.end_all_emergencies(c)
            detail = {"created_at": manifest.created_at.isoformat(), "erased_again": erased_counts}
            audit.record(c, None, RESTORED, "database", None, detail)
        with db.read() as c:
            people, visits = count_patients_and_sessions(c)
            names_open = not identities.find_problems(c, stage.identity_key_file)
        set_mark(db, stage.mark)
    fs.sync_file(stage.database)
    files = sum(1 for _ in blobs.files()) + sum(1 for _ in stage.live.iterdir())
    return RestoredClinic(
        manifest.created_at, people, visits, files, erased_counts, len(manifest.missing), names_open
    )


def _extract(archive: Path, stage: Settings, key: ClinicKey | None) -> BackupManifest:
    """Extract every file of the archive and compare it with the manifest, which comes last."""
    extracted: set[tuple[str, int, str]] = set()
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
                extracted.add((name, size, _write(stage.data_dir / name, content)))
            else:
                raise RestoreError(f"{archive.name} holds '{name[:80]}', which no backup does.")
    if manifest is None:
        raise RestoreError(f"{archive.name} is damaged or was cut: it has no manifest. Use another backup.")
    if extracted != manifest.files:
        wrong = sorted(one[0] for one in extracted ^ manifest.files)
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
    """Repeat the listed erasures; return the numbers of patients and sessions."""
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


def _at(settings: Settings, folder: Path) -> Settings:
    """Settings for the same installation in another folder, with a database file there."""
    return replace(
        settings, data_dir=folder, database_url="", bucket="", identity_key="", node_name="", node_address=""
    )


def _fill_bucket(settings: Settings, stage: Settings) -> None:
    """Upload every stored file of the stage, so that only the database remains to be put in place."""
    bucket, staged = open_empty_bucket(settings), FolderBlobs(stage.blobs)
    for one in staged.files():
        bucket.adopt(one.space, staged.path(one.space, one.name), one.name)
    fs.remove_tree(stage.blobs)
    write_note(replace(stage, bucket=settings.bucket))


def _put_in_place(settings: Settings, stage: Settings) -> None:
    fs.write_file(name_placing(stage.data_dir), settings.bucket.encode())
    if settings.bucket:
        _fill_bucket(settings, stage)
    for source, target in (
        (stage.blobs, settings.blobs),
        (stage.live, settings.live),
        (stage.mark, settings.mark),
        (stage.second_factor_key, settings.second_factor_key),
        (stage.identity_key_file, settings.data_dir / IDENTITY_KEY),
        *(() if settings.database_url else ((stage.database, settings.database),)),
    ):
        if source.exists():
            fs.move_file(source, target)
            fs.sync_folder(settings.data_dir)
    if settings.database_url:
        copy_database(stage.database, settings.database_source)
    fs.remove_tree(stage.data_dir)
