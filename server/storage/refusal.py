"""Uniform classification of disk write errors of the system, SQLite and PostgreSQL.

if refusal_of(error) is not None: ...     # nothing was written; stored data can still be read
"""

from __future__ import annotations

import errno
import sqlite3
from enum import StrEnum

from sqlalchemy.exc import DBAPIError, OperationalError

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""Error numbers of a full file system, an exceeded quota or a file size limit."""


class Refusal(StrEnum):
    """Reason why the disk rejects writes; the value is the code of the problem."""

    FULL = "disk_full"
    NOT_WRITABLE = "disk_not_writable"

    @property
    def sentence(self) -> str:
        """Message for users."""
        return _SENTENCES[self]


_SENTENCES = {
    Refusal.FULL: "The server's disk is full, so nothing was saved. Ask the administrator to make room, "
    "then try again.",
    Refusal.NOT_WRITABLE: "The server's disk cannot be written, so nothing was saved. Ask the administrator "
    "to repair it, then try again.",
}

_SQLITE = {
    sqlite3.SQLITE_FULL: Refusal.FULL,
    sqlite3.SQLITE_IOERR_SHMSIZE: Refusal.FULL,  # no space for the index of the write-ahead log
    sqlite3.SQLITE_READONLY: Refusal.NOT_WRITABLE,
    sqlite3.SQLITE_IOERR_WRITE: Refusal.NOT_WRITABLE,  # SQLite itself reports FULL for ENOSPC
    sqlite3.SQLITE_IOERR_TRUNCATE: Refusal.NOT_WRITABLE,
}


_POSTGRES = {
    "53100": Refusal.FULL,  # disk_full
    "25006": Refusal.NOT_WRITABLE,  # read_only_sql_transaction: a standby
}
_PASSING = {"55P03", "57P01", "57P03", None}
"""PostgreSQL's lock_not_available, admin_shutdown, cannot_connect_now; None = no connection."""


def is_busy(error: BaseException) -> bool:
    """Whether another writer held the database for too long, or PostgreSQL is unavailable; retrying
    may help.
    """
    if not isinstance(error, OperationalError):
        return False
    passes = getattr(error.orig, "sqlstate", "of SQLite") in _PASSING
    return passes or error.connection_invalidated or "locked" in str(error.orig)


def refusal_of(error: BaseException) -> Refusal | None:
    """Classify a disk error; None if the error is of another kind."""
    if isinstance(error, DBAPIError):
        error = error.orig or error
    if isinstance(error, sqlite3.Error):
        code = getattr(error, "sqlite_errorcode", None)
        # the lowest byte of an extended code is the primary code
        return None if code is None else _SQLITE.get(code) or _SQLITE.get(code & 0xFF)
    state = getattr(error, "sqlstate", None)
    if state is not None:
        return _POSTGRES.get(state)
    if isinstance(error, OSError):
        if error.errno in FULL:
            return Refusal.FULL
        return Refusal.NOT_WRITABLE if error.errno == errno.EROFS else None
    return None
