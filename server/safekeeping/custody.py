"""Guard against deleting stored files on the evidence of an emptied or restored database.

refuse_strangers(settings)      # before the start: files exist but the database has no patient
doubt(c, settings)              # before deleting files: None, or the reason for doubt
accept(db, settings)            # the operator confirms this database (`sagittal accept`)
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from contextlib import closing

from sqlalchemy import Connection, func, select
from sqlalchemy.exc import DatabaseError

from sagittal.server import audit
from sagittal.server.safekeeping import erasure
from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blob_opening import open_blobs
from sagittal.server.storage.files.blobs import INCOMING, StoreAway
from sagittal.server.storage.high_water import explain_lost_rows, read_newest, set_mark
from sagittal.server.storage.migrate import exists
from sagittal.server.storage.schema.tables import audit as audit_table
from sagittal.server.storage.schema.tables import patient

log = logging.getLogger(__name__)

ACCEPTED = "database.accepted"


class StrangersError(RuntimeError):
    """Stored files are unknown to the database; the message contains a remedy."""


def refuse_strangers(settings: Settings) -> None:
    """Raise StrangersError if stored files exist and the database is missing or has no patients.

    Creates no database; an unreadable file is left to `storage.migrate`, which reports it.
    """
    if not exists(settings.database_source):
        refuse_half_restored(settings)
        text = _strangers_if_known(settings, erased=set())
    else:
        with closing(Database(settings.database_source)) as db:
            try:
                with db.read() as c:
                    text = _strangers_of(c, settings, _strangers_if_known)
            except DatabaseError as error:
                if "no such table" not in str(error.orig):
                    return
                text = _strangers_if_known(settings, erased=set())
    if text is not None:
        raise StrangersError(text)


def refuse_half_restored(settings: Settings) -> None:
    """Raise StrangersError if a restore was interrupted before the database was in place; creates nothing."""
    if settings.restoring.exists() and not exists(settings.database_source):
        raise StrangersError(
            f"A restore into {settings.data_dir} was interrupted. Run `sagittal restore` again; to begin "
            f"an empty clinic instead, remove {settings.restoring} first."
        )


def refuse_wrong_clock(db: Database, settings: Settings) -> bool:
    """Raise StrangersError if this host's clock differs from the database's; False = the database is
    local.
    """
    theirs = db.read_clock()
    if theirs is None:
        return False
    apart = abs(time.time() - theirs)
    if apart > settings.lease_s / 3:
        raise StrangersError(
            f"This computer's clock and PostgreSQL's are {apart:.1f} s apart, allowed are "
            f"{settings.lease_s / 3:.1f}. Set both by NTP."
        )
    return True


def refuse_foreign_folder(
    db: Database, settings: Settings, stop: threading.Event, patience_s: float = 10.0
) -> None:
    """Raise StrangersError if this host's data folder or clock does not match the PostgreSQL database.

    A worker on another host needs the server's folder of stored files (a network share), and leases require
    synchronized clocks. The server writes the mark some seconds after the first row of the audit log; until
    then there is no work, and this function waits (`stop` ends it).
    """
    if not refuse_wrong_clock(db, settings):
        return
    until = time.monotonic() + patience_s
    while not settings.mark.exists() and not stop.wait(0.2):
        with db.read() as c:
            nobody_works = read_newest(c) is None
        if nobody_works:
            until = time.monotonic() + patience_s
        elif time.monotonic() > until:
            break
    if stop.is_set():
        return
    with db.read() as c:
        lost = explain_lost_rows(c, settings.mark)
    if lost is not None or not settings.mark.exists():
        raise StrangersError(
            f"{settings.data_dir} is not the data folder of this database's server"
            f"{f' ({lost})' if lost else ''}. Share that folder with this computer and name it by --data."
        )


def find_doubt(c: Connection, settings: Settings) -> str | None:
    """Reason not to delete files on the evidence of this database, as a sentence; None = none."""
    try:
        return _doubt(c, settings)
    except StoreAway:
        return (
            f"The database in {settings.data_dir} knows no patient, and {settings.bucket} does not say now "
            "whether stored files are there."
        )


def accept(db: Database, settings: Settings) -> str | None:
    """Trust this database from now on; return the former doubt, None = there was none. Raises StoreAway."""
    with db.write() as c:
        doubted = _doubt(c, settings)
        if doubted is not None:
            audit.record(c, None, ACCEPTED, "database", None, {"by": "console", "doubt": doubted})
    set_mark(db, settings.mark)
    return doubted


def _doubt(c: Connection, settings: Settings) -> str | None:
    return explain_lost_rows(c, settings.mark) or _strangers_of(c, settings, _strangers)


def _strangers_of(
    c: Connection, settings: Settings, look: Callable[[Settings, set[str]], str | None]
) -> str | None:
    if c.execute(select(func.count()).select_from(patient)).scalar_one():
        return None
    if c.execute(select(audit_table.c.seq).where(audit_table.c.action == ACCEPTED).limit(1)).first():
        return None
    return look(settings, erasure.list_erased_spaces(c))


def _strangers_if_known(settings: Settings, erased: set[str]) -> str | None:
    """Like `_strangers`, but None if the files are in a bucket that is unavailable."""
    try:
        return _strangers(settings, erased)
    except StoreAway:
        log.warning("%s cannot be asked whether it holds another clinic's files", settings.bucket)
        return None


def _strangers(settings: Settings, erased: set[str]) -> str | None:
    spaces, takes = erasure.list_unfinished(settings)
    leaving = erased | spaces | {INCOMING}
    # a folder that never belonged to a clinic is left unchanged: opening would create files
    stored = open_blobs(settings).files() if settings.bucket or settings.blobs.exists() else ()
    files = sum(1 for f in stored if f.space not in leaving)
    paths = (path for folder in settings.live_folders for path in folder.glob("*.log"))
    logs = sum(1 for path in paths if path.stem not in takes)
    if not files and not logs:
        return None
    return (
        f"The database in {settings.data_dir} knows no patient, but {files} stored files and {logs} live "
        "logs are there. Put back its backup, or run `sagittal accept` to go on without them."
    )
