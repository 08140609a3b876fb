"""References of a session: orientations of another system for comparison, kept separate from the recording.

A file of the same name replaces the previous one; comparisons that used that retain it.
"""

from __future__ import annotations

from typing import Final

from sqlalchemy import Connection, delete, func, insert, select

from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import sessions
from sagittal.server.errors import NotFound, TooLarge
from sagittal.server.storage.files.blobs import Blob, BlobStore
from sagittal.server.storage.schema.tables import now, reference_file
from sagittal.server.uploads.receiving import receive
from sagittal.server.uploads.recordings import RecordedFile

MOST_FILES: Final = 20
"""References per session (our choice)."""


def list_files(c: Connection, session_id: str) -> list[RecordedFile]:
    """References of a session by name; raises NotFound for the session."""
    sessions.get(c, session_id)
    query = select(reference_file).where(reference_file.c.session_id == session_id)
    return [RecordedFile(f.name, f.size, f.sha256) for f in c.execute(query.order_by(reference_file.c.name))]


def get(c: Connection, session_id: str, name: str) -> RecordedFile:
    """One reference; raises NotFound."""
    file = next((f for f in list_files(c, session_id) if f.name == name), None)
    if file is None:
        raise NotFound("reference", name)
    return file


def file_bytes(c: Connection, blobs: BlobStore, session_id: str, name: str) -> bytes:
    """Read and verify a reference as uploaded; raises NotFound, IntegrityError."""
    file = get(c, session_id, name)
    return blobs.read(sessions.get(c, session_id).patient_id, file.sha256)


def remove(c: Connection, actor: audit.Actor | None, session_id: str, name: str) -> None:
    """Delete a reference; comparisons that used it are unchanged. Raises NotFound."""
    get(c, session_id, name)
    c.execute(delete(reference_file).filter_by(session_id=session_id, name=name))
    audit.record(c, actor, "reference.removed", "session", session_id)


class receive_reference(receive):  # noqa: N801 - as `receive`
    """Reception of a reference; like `receive`."""

    def _check_set(self, c: Connection, size: int) -> None:
        """No check, as the recording's set is unaffected."""

    def _add(self, c: Connection, blob: Blob) -> RecordedFile:
        key = {"session_id": self._session_id, "name": self._name}
        c.execute(delete(reference_file).filter_by(**key))
        mine = reference_file.c.session_id == self._session_id
        if c.execute(select(func.count()).select_from(reference_file).where(mine)).scalar_one() >= MOST_FILES:
            raise TooLarge(
                "too_many_files",
                Message("A visit has at most {MOST_FILES} references; remove one.", MOST_FILES=MOST_FILES),
            )
        c.execute(insert(reference_file).values(**key, size=blob.size, sha256=blob.sha256, added_at=now()))
        detail = {"session_id": self._session_id, "sha256": blob.sha256, "size": blob.size}
        audit.record(c, self._actor, "reference.added", "session", self._session_id, detail)
        return RecordedFile(self._name, blob.size, blob.sha256)
