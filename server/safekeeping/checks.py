"""Integrity checks of `sagittal check`."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy.exc import DatabaseError

from sagittal.core.errors import SagittalError
from sagittal.server import audit
from sagittal.server.auth import second_factor
from sagittal.server.clinic import identities
from sagittal.server.live_takes import live_logs
from sagittal.server.safekeeping import custody
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import BlobStore, StoreAway, digest_open
from sagittal.server.storage.files.trash import Trash, TrashedFile
from sagittal.server.storage.high_water import explain_lost_rows
from sagittal.server.storage.references import list_referenced


@dataclass(frozen=True)
class StorageDefect:
    """One defect.

    Parameters
    ----------
    area : database, files, live, trash, audit, or keys (values that cannot be decrypted).
    message : description and location.
    """

    area: str
    message: str


def check(
    db: Database,
    blobs: BlobStore,
    settings: Settings,
    *,
    known_missing: Collection[tuple[str, str]] = (),
    kept_head: Path | None = None,
) -> list[StorageDefect]:
    """Check database, hashes of stored files, live logs, trash, audit chain and encrypted values.

    Parameters
    ----------
    known_missing : files (space, sha256) known to be missing.
    kept_head : a copy of `audit.mark` stored elsewhere: the log must still contain that row.

    Raises
    ------
    StoreAway
        the stored files are unavailable.
    """
    try:
        defects = [StorageDefect("database", text) for text in db.problems()]
        with db.read() as c:
            used = sorted(list_referenced(c))
            defects += [StorageDefect("audit", text) for text in audit.find_problems(c)]
            cut = None if kept_head is None else explain_lost_rows(c, kept_head)
            doubted = custody.find_doubt(c, settings)
            unread = [
                *identities.find_problems(c, settings.identity_key_file),
                *second_factor.find_problems(c, settings.second_factor_key),
            ]
            defects += [StorageDefect("keys", text) for text in unread]
    except DatabaseError as error:
        return [StorageDefect("database", f"cannot be read ({error.orig}); restore it from a backup")]
    if doubted is not None:
        text = f"{doubted} No stored file is taken away until the right one is back or `sagittal accept`."
        defects.append(StorageDefect("audit", text))
    if kept_head is not None and not kept_head.is_file():
        cut = f"There is no file {kept_head}, so nobody knows whether the audit log is whole."
    if cut is not None:
        defects.append(StorageDefect("audit", cut))
    trash = list(blobs.trash.files())
    waiting = {(one.space, one.name) for one in trash}
    return [
        *defects,
        *_check_files(blobs, [one for one in used if one not in known_missing], waiting),
        *_check_live(db, settings),
        *(f for one in trash for f in _check_discarded(blobs.trash, one)),
    ]


def _check_files(
    blobs: BlobStore, used: Sequence[tuple[str, str]], waiting: Collection[tuple[str, str]]
) -> Iterator[StorageDefect]:
    """Open every referenced file and verify its hash; those in `waiting` are in the trash."""
    for space, sha256 in used:
        try:
            blobs.open(space, sha256).close()
        except StoreAway:
            raise
        except SagittalError as error:
            text = f"patient {space}: {error.message}"
            if (space, sha256) in waiting:
                text = f"patient {space}: {sha256[:12]}… lies in the trash; run `sagittal trash --restore`."
            yield StorageDefect("files", text)
        except OSError as error:
            yield StorageDefect("files", f"patient {space}, file {sha256[:12]}…: {error.strerror}")


def _check_live(db: Database, settings: Settings) -> list[StorageDefect]:
    defects = []
    with db.read() as c:
        for log in live_logs.list_logs(c, settings):
            if not log.known:
                text = f"the database knows nothing of {log.path.name} ({log.words}); see `sagittal adopt`."
                defects.append(StorageDefect("live", text))
            if log.damage is not None:
                defects.append(StorageDefect("live", f"{log.path.name}: {log.damage.sentence}"))
    for path in live_logs.list_originals(settings):
        text = f"{path.name} is the original of a damaged log; remove it when nobody needs it any more."
        defects.append(StorageDefect("live", text))
    return defects


def _check_discarded(trash: Trash, one: TrashedFile) -> list[StorageDefect]:
    try:
        with trash.open(one) as file:
            whole = digest_open(file) == one.name
    except OSError as error:
        return [StorageDefect("trash", f"{trash.place}/{one.way}: {error.strerror}")]
    return [] if whole else [StorageDefect("trash", f"{trash.place}/{one.way} has changed on the disk.")]
