"""Whether this database may say which stored files are needed; not after it was emptied or put back.

refuse_strangers(settings)      # before the start: files are here and the database knows no patient
doubt(c, settings)              # before any file is taken away: None, or why it is not
accept(db, settings)            # somebody answers: this database is the right one (`sagittal accept`)
"""

from __future__ import annotations

import threading
import time
from contextlib import closing

from sqlalchemy import Connection, func, select
from sqlalchemy.exc import DatabaseError

from server import audit
from server.services import erasure
from server.settings import Settings
from server.storage.blobs import INCOMING, BlobStore
from server.storage.db import Database
from server.storage.high_water import explain_lost_rows, read_newest, set_mark
from server.storage.migrate import exists
from server.storage.tables import audit as audit_table
from server.storage.tables import patient

ACCEPTED = "database.accepted"


class StrangersError(RuntimeError):
    """Stored files are here that the database knows nothing of; the message says what to do."""


def refuse_strangers(settings: Settings) -> None:
    """Raise StrangersError when files are here and the database is missing or knows no patient.

    Creates no database; a file that cannot be read is left to `storage.migrate`, which says so.
    """
    if not exists(settings.database_source):
        if settings.restoring.exists():
            raise StrangersError(
                f"A restore into {settings.data_dir} was interrupted. Run `sagittal restore` again; to begin "
                f"an empty clinic instead, remove {settings.restoring} first."
            )
        text = _strangers(settings, erased=set())
    else:
        with closing(Database(settings.database_source)) as db:
            try:
                with db.read() as c:
                    text = _strangers_of(c, settings)
            except DatabaseError as error:
                if "no such table" not in str(error.orig):
                    return
                text = _strangers(settings, erased=set())
    if text is not None:
        raise StrangersError(text)


def refuse_foreign_folder(
    db: Database, settings: Settings, stop: threading.Event, patience_s: float = 10.0
) -> None:
    """Raise StrangersError where this host's data folder or clock is not that of the PostgreSQL database.

    A worker elsewhere needs the server's own folder of stored files (shared by the network), and leases need
    clocks that agree. The server writes the mark some seconds after the first row of the audit log; until
    there is one nobody has work, and this waits (`stop` ends it).
    """
    theirs = db.read_clock()
    if theirs is None:
        return
    apart = abs(time.time() - theirs)
    if apart > settings.lease_s / 3:
        raise StrangersError(
            f"This computer's clock and PostgreSQL's are {apart:.1f} s apart, allowed are "
            f"{settings.lease_s / 3:.1f}. Set both by NTP."
        )
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
    """Why no stored file may be taken away on the word of this database, as a sentence; None = it may."""
    return explain_lost_rows(c, settings.mark) or _strangers_of(c, settings)


def accept(db: Database, settings: Settings) -> str | None:
    """Trust this database from now on; returns what was doubted, None = nothing was."""
    with db.write() as c:
        doubted = find_doubt(c, settings)
        if doubted is not None:
            audit.record(c, None, ACCEPTED, "database", None, {"by": "console", "doubt": doubted})
    set_mark(db, settings.mark)
    return doubted


def _strangers_of(c: Connection, settings: Settings) -> str | None:
    if c.execute(select(func.count()).select_from(patient)).scalar_one():
        return None
    if c.execute(select(audit_table.c.seq).where(audit_table.c.action == ACCEPTED).limit(1)).first():
        return None
    return _strangers(settings, erasure.list_erased_spaces(c))


def _strangers(settings: Settings, erased: set[str]) -> str | None:
    spaces, takes = erasure.list_unfinished(settings)
    leaving = erased | spaces | {INCOMING}
    files = sum(1 for f in BlobStore(settings.blobs).files() if f.space not in leaving)
    logs = sum(1 for p in settings.live.glob("*.log") if p.stem not in takes)
    if not files and not logs:
        return None
    return (
        f"The database in {settings.data_dir} knows no patient, but {files} stored files and {logs} live "
        "logs are there. Put back its backup, or run `sagittal accept` to go on without them."
    )
