"""Upload sets: the original files of a trial, their inspection, and the mapping of sensors to segments.

A session's current recording is its newest. Its files may change until an analysis or tuning is requested;
then it becomes immutable, and adding or removing a file starts a new one with the same other files. For the
reception of files see server/uploads/receiving.py.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from sqlalchemy import Connection, delete, func, insert, literal, select, update

from sagittal.server import audit
from sagittal.server.errors import Conflict, NotFound
from sagittal.server.jobs.queue import TUNE, VIEW_COLUMNS, JobQueue, JobView, Priority, job_view
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.storage.files.blobs import Blob, BlobStore
from sagittal.server.storage.schema.tables import (
    job,
    new_id,
    now,
    patient,
    recording,
    recording_file,
    session,
)

INSPECT = "inspect"
ANALYSE = "analyse"


@dataclass(frozen=True)
class RecordedFile:
    """A file exactly as uploaded or as written by an analysis: name, size, and sha256."""

    name: str
    size: int
    sha256: str


RecordingState = Literal["draft", "ready", "failed"]


@dataclass(frozen=True)
class StoredRecording:
    """An upload set.

    Parameters
    ----------
    state : draft (not inspected since the last change), ready (inspected), failed (could not be read).
    manifest : the latest mapping, None = not set.
    inspection : inspection results (sagittal.core.quality.describe as JSON), None until inspected.
    job : the latest inspection job, for its progress or error.
    """

    id: str
    session_id: str
    patient_id: str
    state: RecordingState
    files: tuple[RecordedFile, ...]
    manifest: Mapping[str, Any] | None
    inspection: Mapping[str, Any] | None
    job: JobView | None

    @property
    def input_sha256(self) -> str:
        """Digest of all names and contents."""
        return input_digest((f.name, f.sha256) for f in self.files)


def input_digest(files: Iterable[tuple[str, str]]) -> str:
    """sha256 over sorted (name, sha256) pairs."""
    text = "".join(f"{sha256} {name}\n" for name, sha256 in sorted(files))
    return hashlib.sha256(text.encode()).hexdigest()


def current(c: Connection, session_id: str) -> StoredRecording | None:
    """The session's newest recording, None before the first file; raises NotFound for the session."""
    row = c.execute(_QUERY.where(session.c.id == session_id).order_by(*_NEWEST).limit(1)).first()
    if row is None:
        patient_of(c, session_id)
        return None
    return _recording(c, row)


def get(c: Connection, recording_id: str) -> StoredRecording:
    """One recording; raises NotFound."""
    row = c.execute(_QUERY.where(recording.c.id == recording_id)).first()
    if row is None:
        raise NotFound("recording", recording_id)
    return _recording(c, row)


def set_manifest(
    c: Connection, actor: audit.Actor | None, session_id: str, manifest: Mapping[str, Any] | None
) -> StoredRecording:
    """Store a mapping for the current recording; raises ManifestError, Conflict no_files."""
    from sagittal.core.formats.manifest import manifest_of  # slow import

    if manifest is not None:
        manifest_of(manifest)
    this = require_current(c, session_id)
    if this.manifest != manifest:
        values: dict[str, Any] = {"manifest": manifest}
        if _sources(this.manifest) != _sources(manifest):
            values["inspection"] = None  # the files will be read differently
        c.execute(update(recording).where(recording.c.id == this.id).values(values))
        audit.record(c, actor, "recording.mapped", "recording", this.id, {"session_id": session_id})
    return get(c, this.id)


def remove_file(c: Connection, actor: audit.Actor | None, session_id: str, name: str) -> StoredRecording:
    """Remove a file from the current set (of its successor if already analysed); raises NotFound."""
    this = current(c, session_id)
    if this is None or name not in {f.name for f in this.files}:
        raise NotFound("file", name)
    editable = _editable(c, session_id)
    c.execute(
        delete(recording_file).where(recording_file.c.recording_id == editable, recording_file.c.name == name)
    )
    audit.record(c, actor, "recording.file_removed", "recording", editable, {"session_id": session_id})
    return get(c, editable)


def inspect(c: Connection, queue: JobQueue, actor: audit.Actor | None, session_id: str) -> JobView:
    """Request an inspection; unchanged files are inspected only once; raises Conflict no_files."""
    this = require_current(c, session_id)
    if this.inspection is not None and this.job is not None and this.job.state == "done":
        return this.job
    # a set that was changed and changed back has been inspected, but the results were dropped
    earlier = select(func.count()).select_from(job).where(job.c.recording_id == this.id)
    times = c.execute(earlier.where(job.c.kind == INSPECT, job.c.state == "done")).scalar_one()
    declared = hashlib.sha256(repr(_sources(this.manifest)).encode()).hexdigest()[:16]
    view = queue.submit(
        c,
        key=f"{this.id}:{INSPECT}:{this.input_sha256}:{declared}:{times}:{CODE_VERSION}",
        kind=INSPECT,
        params={**job_inputs(this), "manifest": this.manifest},
        recording_id=this.id,
        requested_by=actor.user_id if actor else None,
        priority=Priority.IN_FRONT,
    )
    audit.record(c, actor, "recording.inspected", "recording", this.id, {"job_id": view.id})
    return view


def publish_inspection(
    c: Connection, recording_id: str, input_sha256: str, result: Mapping[str, Any]
) -> None:
    """Store inspection results; raises Conflict files_changed if the set has changed meanwhile."""
    if get(c, recording_id).input_sha256 != input_sha256:
        raise Conflict(
            "files_changed", "Files were added or removed in the meantime; the new set is being checked."
        )
    c.execute(update(recording).where(recording.c.id == recording_id).values(inspection=dict(result)))


def require_current(c: Connection, session_id: str) -> StoredRecording:
    """The current recording with at least one file; raises Conflict no_files."""
    this = current(c, session_id)
    if this is None or not this.files:
        raise Conflict("no_files", "This visit has no files yet; upload the recording first.")
    return this


def job_inputs(this: StoredRecording) -> dict[str, Any]:
    """Files of a job, fixed at submission."""
    files = [{"name": f.name, "size": f.size, "sha256": f.sha256} for f in this.files]
    return {"space": this.patient_id, "files": files, "input_sha256": this.input_sha256}


def file_bytes(c: Connection, blobs: BlobStore, recording_id: str, name: str) -> bytes:
    """Read and verify an original file; raises NotFound, IntegrityError."""
    this = get(c, recording_id)
    for f in this.files:
        if f.name == name:
            return blobs.read(this.patient_id, f.sha256)
    raise NotFound("file", name)


def add_file(
    c: Connection, actor: audit.Actor | None, session_id: str, name: str, blob: Blob
) -> RecordedFile:
    """Add a reference to a stored file to the current set, replacing one of its name."""
    this = current(c, session_id)
    for f in this.files if this else ():
        if (f.name, f.sha256) == (name, blob.sha256):
            return f
    target = _editable(c, session_id)
    key = {"recording_id": target, "name": name}
    c.execute(delete(recording_file).filter_by(**key))
    row = {"size": blob.size, "sha256": blob.sha256, "added_at": now()}
    c.execute(insert(recording_file).values(**key, **row))
    detail = {"session_id": session_id, "sha256": blob.sha256, "size": blob.size}
    audit.record(c, actor, "recording.file_added", "recording", target, detail)
    return RecordedFile(name, blob.size, blob.sha256)


_NEWEST = (recording.c.created_at.desc(), recording.c.id)
_QUERY = select(recording, session.c.patient_id).join(session, session.c.id == recording.c.session_id)


def _recording(c: Connection, row: Any) -> StoredRecording:
    files = c.execute(
        select(recording_file).where(recording_file.c.recording_id == row.id).order_by(recording_file.c.name)
    )
    newest = c.execute(
        select(*VIEW_COLUMNS)
        .where(job.c.recording_id == row.id, job.c.kind == INSPECT)
        .order_by(job.c.seq.desc())
        .limit(1)
    ).first()
    look = job_view(newest) if newest else None
    failed = look is not None and look.state == "failed"
    return StoredRecording(
        id=row.id,
        session_id=row.session_id,
        patient_id=row.patient_id,
        state="ready" if row.inspection is not None else "failed" if failed else "draft",
        files=tuple(RecordedFile(f.name, f.size, f.sha256) for f in files),
        manifest=row.manifest,
        inspection=row.inspection,
        job=look,
    )


def patient_of(c: Connection, session_id: str) -> str:
    """Id of the patient of a session; raises NotFound for the session."""
    owner_id = c.execute(
        select(patient.c.id)
        .join(session, session.c.patient_id == patient.c.id)
        .where(session.c.id == session_id)
    ).scalar()
    if owner_id is None:
        raise NotFound("session", session_id)
    return str(owner_id)


def _editable(c: Connection, session_id: str) -> str:
    """Id of the recording whose files may change; its inspection results are discarded."""
    this = current(c, session_id)
    fixed = (
        this is not None
        and c.execute(
            select(func.count())
            .select_from(job)
            .where(
                job.c.recording_id == this.id,
                job.c.kind.in_((ANALYSE, TUNE)),
                job.c.state.in_(("queued", "running", "done")),
            )
        ).scalar_one()
    )
    if this is not None and not fixed:
        c.execute(update(recording).where(recording.c.id == this.id).values(inspection=None))
        return this.id
    fresh = new_id()
    manifest = this.manifest if this else None
    c.execute(insert(recording).values(id=fresh, session_id=session_id, manifest=manifest, created_at=now()))
    if this is not None:
        columns = [recording_file.c[name] for name in ("name", "size", "sha256", "added_at")]
        files = select(literal(fresh), *columns).where(recording_file.c.recording_id == this.id)
        c.execute(insert(recording_file).from_select(["recording_id", *columns], files))
    return fresh


def _sources(manifest: Mapping[str, Any] | None) -> object:
    """Part of a manifest that determines how files are read."""
    return (manifest or {}).get("sources")
