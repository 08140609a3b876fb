"""Online backups: one file with the database, stored files, live logs and a manifest.

    made = make_backup(db, settings, Path("/mnt/backup"), key)     # an existing folder: named by time
    prune(Path("/mnt/backup"))                                     # retain daily, weekly and monthly ones

Live logs are read first, then a snapshot of the database, then the files it refers to. A trial that ends
meanwhile is thus included as a log or as a recording; stored files never change, and one that is swept
meanwhile is in the trash. The file appears under its name only when complete and on disk.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import io
import json
import logging
import re
import time
from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Final

from sqlalchemy import Connection, func, select, update

from sagittal.server import audit
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.safekeeping.tombstones import find_tombstones, keep_tombstones
from sagittal.server.settings import Settings
from sagittal.server.storage import fs
from sagittal.server.storage.archive import ArchiveWriter, ClinicKey, write_archive
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_opening import open_blobs
from sagittal.server.storage.files.blobs import BlobStore, StoreAway
from sagittal.server.storage.high_water import HighWater, read_newest
from sagittal.server.storage.migrate import copy_database, read_revision
from sagittal.server.storage.references import list_referenced
from sagittal.server.storage.schema.tables import job, new_id, now, patient, session

log = logging.getLogger(__name__)

FORMAT: Final = 1
"""Version of the manifest; later versions may add keys but never change these."""
MANIFEST: Final = "manifest.json"
DATABASE: Final = "sagittal.db"
IDENTITY_KEY: Final = "identity.key"
"""The identity key, wherever it is stored; in encrypted backups only."""
ENDS: Final = (".tar", ".tar.age")
"""File name extension of a backup; other names are folders that do not exist."""
DAYS, WEEKS, MONTHS = 7, 4, 12
"""`prune` retains the newest backup of each of this many days, weeks and months that have any."""
_STAMP: Final = "%Y%m%dT%H%M%SZ"
_NAME: Final = re.compile(r"sagittal-(\d{8}T\d{6}Z)\.tar(?:\.age)?")
_LEFT_BEHIND: Final = re.compile(r"[0-9a-f]{32}\.tmp")
_OLD_S: Final = 86_400.0
"""Age from which a partial file in a backup folder is abandoned."""


class BackupError(Exception):
    """The backup failed; the message gives reason and remedy."""


@dataclass(frozen=True)
class Backup:
    """A backup in a folder: path, start time, size in bytes."""

    path: Path
    at: dt.datetime
    size: int


@dataclass(frozen=True)
class MadeBackup:
    """A completed backup.

    Parameters
    ----------
    path, size : the file, bytes. files : number of stored files and live logs in it.
    head : newest audit row.
    missing : (space, sha256) of referenced files that are missing or damaged and thus not included.
    left_out : the identity key, if not included: the backup is not encrypted, or the key cannot be read.
    """

    path: Path
    size: int
    files: int
    head: HighWater | None
    missing: list[tuple[str, str]]
    left_out: Path | None


@dataclass
class _Content:
    """Content of an archive: name, size and sha256 of each file, and missing files."""

    files: list[tuple[str, int, str]] = field(default_factory=list)
    missing: list[tuple[str, str]] = field(default_factory=list)


def make_backup(
    db: Database, settings: Settings, target: Path, key: ClinicKey | None, actor: audit.Actor | None = None
) -> MadeBackup:
    """Make one backup; a target without the extension of a backup is a folder, and the file is named by time.

    Raises
    ------
    BackupError
        another backup is in progress, or the target cannot be written.
    """
    time = now()
    is_file = target.name.endswith(ENDS)
    folder = target.parent if is_file else target
    path = target if is_file else target / _name(time, key)
    if not folder.is_dir():
        raise BackupError(f"There is no folder {folder}. Make it, or connect the disk, and try again.")
    if path.is_relative_to(settings.data_dir):
        raise BackupError(f"{path} lies in the data folder and would be lost with it. Give another disk.")
    if path.exists():
        raise BackupError(f"{path} exists; a backup is never written over another file.")
    try:
        fs.make_folder(settings.backups)
        lock = fs.Lock(settings.backups / "lock", "another backup")
        try:
            _clear(settings.backups, 0.0)
            _clear(folder, _OLD_S)
            backup = _write(db, settings, path, key, time)
            with db.read() as c:
                keep_tombstones(find_tombstones(c), folder)
        finally:
            lock.release()
    except fs.LockedError as error:
        raise BackupError("Another backup is being made; wait for it.") from error
    except OSError as error:
        raise BackupError(f"{path} could not be written ({error.strerror or error}).") from error
    except StoreAway as error:
        raise BackupError(f"The stored files cannot be read ({error.detail}); no backup was made.") from error
    with db.write() as c:
        detail = {"files": backup.files, "size": backup.size, "missing": len(backup.missing)}
        audit.record(c, actor, "backup.made", "database", None, detail)
    return backup


def list_backups(folder: Path) -> list[Backup]:
    """Backups in a folder, newest first; other files are ignored."""
    backups = []
    for path in folder.iterdir() if folder.is_dir() else ():
        named = _NAME.fullmatch(path.name)
        with contextlib.suppress(ValueError, FileNotFoundError):
            if named is not None:
                time = dt.datetime.strptime(named[1], _STAMP).replace(tzinfo=dt.UTC)
                backups.append(Backup(path, time, path.stat().st_size))
    return sorted(backups, key=lambda one: one.at, reverse=True)


def choose_kept(times: Iterable[dt.datetime]) -> set[dt.datetime]:
    """Backups to retain: the newest of each of the last days, weeks and months that have any."""
    newest_first = sorted(times, reverse=True)
    retained: set[dt.datetime] = set()
    for most, period in (
        (DAYS, lambda t: t.date()),
        (WEEKS, lambda t: t.isocalendar()[:2]),
        (MONTHS, lambda t: (t.year, t.month)),
    ):
        first: dict[object, dt.datetime] = {}
        for moment in newest_first:
            first.setdefault(period(moment), moment)
        retained |= set(list(first.values())[:most])
    return retained


def prune(folder: Path) -> list[Path]:
    """Remove the backups of a folder not selected by `choose_kept`; return their names."""
    backups = list_backups(folder)
    retained = choose_kept(one.at for one in backups)
    gone = [one.path for one in backups if one.at not in retained]
    for path in gone:
        fs.remove_file(path)
    if gone:
        fs.sync_folder(folder)
    return gone


def count_patients_and_sessions(c: Connection) -> tuple[int, int]:
    """Numbers of patients and sessions."""
    people = c.execute(select(func.count()).select_from(patient)).scalar_one()
    return people, c.execute(select(func.count()).select_from(session)).scalar_one()


def _write(
    db: Database, settings: Settings, path: Path, key: ClinicKey | None, time: dt.datetime
) -> MadeBackup:
    content = _Content()
    with fs.IncomingFile(path.parent) as file:
        with write_archive(file, key) as archive:
            _add_live(archive, settings, content)
            with _snapshot(db, settings) as copy, closing(Database(copy)) as snapshot:
                # checkpoints can be recomputed and may be replaced at any moment
                with snapshot.write() as c:
                    c.execute(update(job).values(checkpoint=None))
                with snapshot.read() as c:
                    used, head = sorted(list_referenced(c)), read_newest(c)
                    people, visits = count_patients_and_sessions(c)
                snapshot.close()  # merges its write-ahead log into the file
                revision = read_revision(copy)
                _add(archive, DATABASE, copy, content)
            _add_blobs(archive, settings, used, content)
            with db.read() as c:
                erased = find_tombstones(c)
            content.missing = [one for one in content.missing if one[0] not in erased.patients]
            if settings.second_factor_key.exists():
                _add(archive, settings.second_factor_key.name, settings.second_factor_key, content)
            left_out = _add_names_key(archive, settings, content, encrypted=key is not None)
            manifest = {
                "format": FORMAT,
                "created_at": time.isoformat(),
                "code_version": CODE_VERSION,
                "revision": revision,
                "audit_head": None if head is None else {"seq": head.seq, "hash": head.hash},
                "patients": people,
                "sessions": visits,
                "files": content.files,
                "missing": content.missing,
                "erased": erased.tree(),
            }
            text = json.dumps(manifest).encode()
            archive.add(MANIFEST, io.BytesIO(text), len(text))
        file.keep(path)
        return MadeBackup(path, file.size, len(content.files) - 1, head, content.missing, left_out)


@contextlib.contextmanager
def _snapshot(db: Database, settings: Settings) -> Iterator[Path]:
    """Context with a consistent copy of the database."""
    copy = settings.backups / f"{new_id()}.tmp"
    try:
        fs.keep_private(copy)
        copy_database(db.source, copy)
        yield copy
    finally:
        for path in (copy, *(copy.with_name(copy.name + end) for end in ("-wal", "-shm"))):
            fs.remove_file(path)


def _add(archive: ArchiveWriter, name: str, path: Path, content: _Content) -> None:
    with path.open("rb") as source:
        _add_open(archive, name, source, content)


def _add_open(archive: ArchiveWriter, name: str, source: BinaryIO, content: _Content) -> None:
    # a live log grows meanwhile: the present content is a valid prefix
    size = source.seek(0, io.SEEK_END)
    source.seek(0)
    content.files.append((name, size, archive.add(name, source, size)))


def _add_names_key(
    archive: ArchiveWriter, settings: Settings, content: _Content, *, encrypted: bool
) -> Path | None:
    """Add the identity key if the backup is encrypted; return its path if it was omitted."""
    file = settings.identity_key_file
    try:
        with file.open("rb") as source:
            data = source.read()
    except FileNotFoundError:
        return None
    except OSError:
        log.exception("the key of patients' names cannot be read, and is not in the backup")
        return file
    if not encrypted:
        return file
    content.files.append((IDENTITY_KEY, len(data), archive.add(IDENTITY_KEY, io.BytesIO(data), len(data))))
    return None


def _add_live(archive: ArchiveWriter, settings: Settings, content: _Content) -> None:
    for pattern in ("*.log", "*.damaged"):
        for path in sorted(one for folder in settings.live_folders for one in folder.glob(pattern)):
            with contextlib.suppress(FileNotFoundError):  # its trial has just ended and is now a recording
                _add(archive, f"live/{path.name}", path, content)


def _add_blobs(
    archive: ArchiveWriter, settings: Settings, used: Iterable[tuple[str, str]], content: _Content
) -> None:
    blobs = open_blobs(settings)
    for space, sha256 in used:
        source = _open(blobs, space, sha256)
        if source is None:
            content.missing.append((space, sha256))
            continue
        with source:
            _add_open(archive, f"blobs/{space}/{sha256}", source, content)
        name, _, digest = content.files[-1]
        if digest != sha256:
            # its bytes remain in the archive for manual repair; a restore treats it as damaged
            log.error("%s has changed on the disk; see `sagittal check`", name)
            content.missing.append((space, sha256))


def _open(blobs: BlobStore, space: str, sha256: str) -> BinaryIO | None:
    """Open a stored file, or its copy in the trash since the snapshot; None = neither exists."""
    file = blobs.open_unverified(space, sha256)
    if file is not None:
        return file
    for one in blobs.trash.files():
        if (one.space, one.name) == (space, sha256):
            with contextlib.suppress(FileNotFoundError):
                return blobs.trash.open(one)
    return None


def _clear(folder: Path, least_age_s: float) -> None:
    """Remove the remains of killed backups."""
    for path in folder.iterdir():
        stem = path.name.removesuffix("-wal").removesuffix("-shm")
        with contextlib.suppress(FileNotFoundError):
            if _LEFT_BEHIND.fullmatch(stem) and time.time() - path.stat().st_mtime >= least_age_s:
                fs.remove_file(path)


def _name(time: dt.datetime, key: ClinicKey | None) -> str:
    return f"sagittal-{time:{_STAMP}}.tar{'' if key is None else '.age'}"
