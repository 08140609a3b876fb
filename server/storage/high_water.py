"""High-water mark of the audit log in a file next to the database: `audit.mark`.

A database that was emptied, restored from a backup or truncated has fewer rows than the mark, or different
ones. Files unknown to such a database must not be considered unreferenced.

    gone_back(c, settings.mark)      # None, or a sentence: the database was replaced
    raise_mark(db, settings.mark)    # follow the log; unchanged if the database was restored
    set_mark(db, settings.mark)      # trust this database from now on

The mark is written after the commit it refers to, so after a crash it may lag but never lead.
"""

from __future__ import annotations

import json
import logging
import re
import sqlite3
import threading
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Connection, select
from sqlalchemy.exc import SQLAlchemyError

from sagittal.core.formats.json_tree import read_json
from sagittal.server.storage import fs
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import audit

log = logging.getLogger(__name__)

INTERVAL_S: Final = 5.0
"""Update interval; each update costs two syncs, and happens only after writes."""
_HASH: Final = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class HighWater:
    """The newest audit row ever seen: its number, from 1, and its hash, 64 hex digits."""

    seq: int
    hash: str


class DamagedMarkError(Exception):
    """The file exists but is not a valid mark."""


def read_mark(path: Path) -> HighWater | None:
    """The mark, None before the first; raises DamagedMarkError, OSError."""
    try:
        data: Any = read_json(path.read_bytes())
        mark = HighWater(data["seq"], data["hash"])
    except FileNotFoundError:
        return None
    except (ValueError, TypeError, KeyError) as error:
        raise DamagedMarkError(path.name) from error
    if type(mark.seq) is not int or mark.seq < 1 or not _HASH.fullmatch(str(mark.hash)):
        raise DamagedMarkError(path.name)
    return mark


def read_newest(c: Connection) -> HighWater | None:
    """The last row of the audit log, None if empty."""
    row = c.execute(select(audit.c.seq, audit.c.hash).order_by(audit.c.seq.desc()).limit(1)).first()
    return None if row is None else HighWater(row.seq, row.hash)


def explain_lost_rows(c: Connection, path: Path) -> str | None:
    """Reason why the database has been replaced, as a sentence; None if it has not or this is unknown.

    Parameters
    ----------
    path : the mark. It is ahead of `c` only if the database has lost rows.
    """
    try:
        mark = read_mark(path)
    except (DamagedMarkError, OSError) as error:
        return f"{path.name} cannot be read ({error}), so nobody knows whether the audit log is whole."
    if mark is None:
        return None
    last = read_newest(c)
    if last is None or last.seq < mark.seq:
        return (
            f"The audit log ends at row {last.seq if last else 0}, but had reached row {mark.seq}: the "
            "database is an older one, or its end was cut."
        )
    digest = c.execute(select(audit.c.hash).where(audit.c.seq == mark.seq)).scalar()
    if digest != mark.hash:
        return f"Audit row {mark.seq} is not the one that was here before: this is another database."
    return None


def raise_mark(db: Database, path: Path) -> bool:
    """Update the mark to the newest row; False, with the mark unchanged, if the database was restored."""
    with db.read() as c:
        if explain_lost_rows(c, path) is not None:
            return False
        last = read_newest(c)
    _write(path, last)
    return True


def set_mark(db: Database, path: Path) -> None:
    """Set the mark to the newest row unconditionally, after an operator has confirmed this database."""
    with db.read() as c:
        last = read_newest(c)
    _write(path, last)


def _write(path: Path, last: HighWater | None) -> None:
    if last is None:
        fs.remove_file(path)
        return
    fs.write_file(path, json.dumps(asdict(last)).encode() + b"\n")


class MarkKeeper:
    """Thread that updates the mark with the audit log; one in each web process."""

    def __init__(self, db: Database, path: Path, interval_s: float = INTERVAL_S) -> None:
        self._db, self._path, self._interval_s = db, path, interval_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="audit-mark", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Write the final mark and end."""
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        with self._db.watch() as changes:
            due = refused = last = False
            while not last:
                last = self._stop.wait(self._interval_s)
                try:
                    due = changes.has_changed() or due
                    if due:
                        # one at a time: otherwise the slower of two would lower the mark
                        with self._db.do_alone("mark") as is_mine:
                            if is_mine:
                                raise_mark(self._db, self._path)
                        due = not is_mine
                    refused = False
                except (OSError, SQLAlchemyError, sqlite3.Error) as error:
                    # a full disk must not stop the clinic; the mark only lags
                    if not refused:
                        log.warning("%s is not written (%s); trying again", self._path.name, error)
                    refused = True
