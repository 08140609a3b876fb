"""`sagittal check`: is everything that is stored still what was stored?"""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy.exc import DatabaseError

from core.errors import SagittalError
from server import audit
from server.services.sweep import referenced
from server.storage.blobs import BlobStore
from server.storage.db import Database


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Parameters
    ----------
    area : database, files or audit.
    message : what, and where.
    """

    area: str
    message: str


def check(db: Database, blobs: BlobStore) -> list[Finding]:
    """Check the database's structure and keys, every referenced file by its hash, and the audit chain."""
    try:
        found = [Finding("database", text) for text in db.problems()]
        with db.read() as c:
            used = sorted(referenced(c))
            found += [Finding("audit", text) for text in audit.problems(c)]
    except DatabaseError as error:
        return [Finding("database", f"cannot be read ({error.orig}); restore it from a backup")]
    for space, sha256 in used:
        try:
            blobs.read(space, sha256)
        except SagittalError as error:
            found.append(Finding("files", f"patient {space}: {error.message}"))
        except OSError as error:
            found.append(Finding("files", f"patient {space}, file {sha256[:12]}…: {error.strerror}"))
    return found
