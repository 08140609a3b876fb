"""Resumable uploads of files in parts, which survive a restart of the server.

Received data are stored as `<id>.part` in the folder of files being received; a part is acknowledged when it
is on disk. Once the file is complete and its SHA-256 matches, it is renamed to its name in the store and gets
its row in the session, like a file uploaded at once.
"""

from __future__ import annotations

import datetime as dt
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Connection, delete, insert, select, update

from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.errors import Conflict, NotFound, ServiceError, TooLarge
from sagittal.server.settings import Settings
from sagittal.server.storage import fs, references
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import Blob, BlobStore
from sagittal.server.storage.schema.tables import file_upload, new_id, now
from sagittal.server.uploads import receiving, recordings
from sagittal.server.uploads.recordings import RecordedFile

ABANDONED: Final = dt.timedelta(days=1)
"""Uploads idle for longer than this are deleted."""


@dataclass(frozen=True)
class FileUpload:
    """A file being uploaded.

    Parameters
    ----------
    name, size : of the complete file. offset : bytes on the server's disk, where the next part begins.
    """

    id: str
    name: str
    size: int
    offset: int


def begin(
    db: Database,
    blobs: BlobStore,
    settings: Settings,
    actor: audit.Actor | None,
    session_id: str,
    name: str,
    size: int,
) -> FileUpload:
    """Announce a file of a given size, or find its unfinished upload by name and size.

    Raises
    ------
    NotFound; InputError bad_file_name; TooLarge; DiskFull.
    """
    name = receiving.check_name(name)
    if size < 1:
        raise ServiceError(
            "bad_value", Message("The file has {size} bytes; an upload in parts has at least 1.", size=size)
        )
    if size > settings.max_file_bytes:
        raise receiving.make_too_large(name, settings.max_file_bytes)
    with db.write() as c:
        recordings.patient_of(c, session_id)
        reserved = 0
        coming = list_coming(c, blobs, session_id)
        for one in coming:
            if (one.name, one.size) == (name, size):
                return one
            reserved += one.size
        if len(coming) >= settings.max_files:
            raise TooLarge(
                "too_many_files",
                Message("At most {max_files} files can be uploaded at a time.", max_files=settings.max_files),
            )
        receiving.check_set(c, settings, session_id, name, size + reserved)
        receiving.require_room(blobs, settings, size)
        fresh = new_id()
        row = {"id": fresh, "session_id": session_id, "name": name, "size": size, "created_at": now()}
        c.execute(insert(file_upload).values(row))
        audit.record(c, actor, "upload.begun", "session", session_id, {"upload_id": fresh, "size": size})
    return FileUpload(fresh, name, size, 0)


def list_coming(c: Connection, blobs: BlobStore, session_id: str) -> list[FileUpload]:
    """Unfinished uploads of a session, oldest first."""
    query = _QUERY.where(file_upload.c.session_id == session_id, file_upload.c.finished_sha256.is_(None))
    return [_describe(blobs, row) for row in c.execute(query)]


def get(c: Connection, blobs: BlobStore, session_id: str, upload_id: str) -> FileUpload:
    """One upload; a finished one has all its bytes. Raises NotFound."""
    return _describe(blobs, _find(c, session_id, upload_id))


def add_part(
    db: Database,
    blobs: BlobStore,
    settings: Settings,
    session_id: str,
    upload_id: str,
    offset: int,
    data: bytes,
) -> FileUpload:
    """Append bytes durably.

    Raises
    ------
    NotFound; Conflict upload_gap: wrong offset; TooLarge if it exceeds the announced size; DiskFull.
    """
    with blobs.hold_part(upload_id):
        with db.read() as c:
            this = get(c, blobs, session_id, upload_id)
        if offset != this.offset:
            raise Conflict(
                "upload_gap",
                Message(
                    "Received bytes from {offset}, expected bytes from {offset2}. Send those.",
                    offset=offset,
                    offset2=this.offset,
                ),
            )
        if offset + len(data) > this.size:
            raise TooLarge(
                "file_too_large",
                Message(
                    "'{name}' was announced with {size} bytes but more arrived. Start over.",
                    name=this.name,
                    size=this.size,
                ),
            )
        if not data:
            return this
        receiving.require_room(blobs, settings, len(data))
        path = blobs.part(upload_id)
        if not path.exists():
            fs.keep_private(path)
            fs.sync_folder(path.parent)
        part = fs.AppendOnlyFile(path, offset)
        try:
            part.append(data)
            part.sync()
        finally:
            part.close()
        return FileUpload(this.id, this.name, this.size, part.size)


def finish(
    db: Database,
    blobs: BlobStore,
    settings: Settings,
    actor: audit.Actor | None,
    session_id: str,
    upload_id: str,
    sha256: str,
) -> RecordedFile:
    """Add the complete file to the session; idempotent.

    Raises
    ------
    NotFound; TooLarge. Conflict upload_incomplete: bytes are missing; upload_damaged: the hash differs,
    and the upload
        restarts at 0.
    """
    with blobs.hold_part(upload_id):
        with db.read() as c:
            row = _find(c, session_id, upload_id)
        if row.finished_sha256 == sha256:
            return RecordedFile(row.name, row.size, sha256)
        this, path = _describe(blobs, row), blobs.part(upload_id)
        if row.finished_sha256 is not None:
            raise Conflict(
                "upload_damaged", "This upload was completed with another SHA-256. Start a new one."
            )
        if this.offset < this.size:
            raise Conflict(
                "upload_incomplete",
                Message(
                    "{offset} of {size} bytes received. Send the rest first.",
                    offset=this.offset,
                    size=this.size,
                ),
            )
        if _hash(path) != sha256:
            fs.remove_file(path)
            raise Conflict(
                "upload_damaged",
                Message(
                    "The SHA-256 of the received '{name}' differs from the sent one. Send it again from 0.",
                    name=this.name,
                ),
            )
        with db.read() as c:
            space = recordings.patient_of(c, session_id)
            receiving.check_set(c, settings, session_id, this.name, this.size)
        # before the transaction: uploading to a bucket takes a while
        blobs.adopt(space, path, sha256)
        try:
            stored = _publish(db, blobs, settings, actor, session_id, this, sha256)
        except NotFound:
            # erased in the meantime: nothing of it may remain, not even in the trash
            fs.remove_file(path)
            references.discard(db, blobs, space, [sha256])
            raise
        fs.remove_file(path)
        return stored


def _publish(
    db: Database,
    blobs: BlobStore,
    settings: Settings,
    actor: audit.Actor | None,
    session_id: str,
    this: FileUpload,
    sha256: str,
) -> RecordedFile:
    with db.write() as c:
        _find(c, session_id, this.id)
        blobs.require(recordings.patient_of(c, session_id), sha256)
        receiving.check_set(c, settings, session_id, this.name, this.size)
        stored = recordings.add_file(c, actor, session_id, this.name, Blob(sha256, this.size))
        mine = file_upload.c.id == this.id
        c.execute(update(file_upload).where(mine).values(finished_sha256=sha256))
    return stored


def cancel(
    db: Database, blobs: BlobStore, actor: audit.Actor | None, session_id: str, upload_id: str
) -> None:
    """Delete an upload and its data; raises NotFound. A finished file remains."""
    with blobs.hold_part(upload_id):
        with db.write() as c:
            _find(c, session_id, upload_id)
            c.execute(delete(file_upload).where(file_upload.c.id == upload_id))
            audit.record(c, actor, "upload.cancelled", "session", session_id, {"upload_id": upload_id})
        fs.remove_file(blobs.part(upload_id))


def list_parts(c: Connection) -> set[str]:
    """Names of the files of all unfinished uploads."""
    return {BlobStore.name_part(one) for one in c.execute(select(file_upload.c.id)).scalars()}


def drop_abandoned(db: Database, blobs: BlobStore) -> None:
    """Delete uploads idle for a day, and records of finished ones."""
    limit = now() - ABANDONED
    with db.read() as c:
        old = list(c.execute(_QUERY.where(file_upload.c.created_at < limit)))
    for row in old:
        with blobs.hold_part(row.id):
            path = blobs.part(row.id)
            if path.exists() and path.stat().st_mtime >= limit.timestamp():
                continue
            with db.write() as c:
                c.execute(delete(file_upload).where(file_upload.c.id == row.id))
            fs.remove_file(path)


_QUERY = select(file_upload).order_by(file_upload.c.created_at, file_upload.c.id)


def _find(c: Connection, session_id: str, upload_id: str) -> Any:
    mine = (file_upload.c.id == upload_id, file_upload.c.session_id == session_id)
    row = c.execute(_QUERY.where(*mine)).first()
    if row is None:
        raise NotFound("upload", upload_id)
    return row


def _describe(blobs: BlobStore, row: Any) -> FileUpload:
    path = blobs.part(row.id)
    length = path.stat().st_size if path.exists() else 0
    return FileUpload(row.id, row.name, row.size, row.size if row.finished_sha256 else min(length, row.size))


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
