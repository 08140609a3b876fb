"""References from rows to stored files."""

from __future__ import annotations

from collections.abc import Iterable

from sqlalchemy import Connection, select, union

from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.storage.schema.report_tables import report_file, signed_report
from sagittal.server.storage.schema.tables import (
    analysis,
    analysis_file,
    filter_run,
    filter_run_file,
    job,
    patient,
    recording,
    recording_file,
    reference_file,
    session,
    session_video,
)


def list_referenced(c: Connection, session_id: str | None = None) -> set[tuple[str, str]]:
    """All (space, sha256) referenced by rows, of one session or all."""
    of_session = patient.join(session, session.c.patient_id == patient.c.id)
    of_take = of_session.join(recording, recording.c.session_id == session.c.id)
    of_analysis = of_take.join(analysis, analysis.c.recording_id == recording.c.id)
    of_run = of_analysis.join(filter_run, filter_run.c.analysis_id == analysis.c.id)
    places = (
        (recording_file.c.sha256, of_take.join(recording_file)),
        (analysis_file.c.sha256, of_analysis.join(analysis_file)),
        (reference_file.c.sha256, of_session.join(reference_file)),
        (session_video.c.sha256, of_session.join(session_video)),
        (report_file.c.sha256, of_session.join(signed_report).join(report_file)),
        (filter_run_file.c.sha256, of_run.join(filter_run_file)),
        # the reference of a run is retained, even if the file was replaced
        (filter_run.c.reference_sha256, of_run),
        (job.c.checkpoint, of_take.join(job, job.c.recording_id == recording.c.id)),
    )
    queries = [select(patient.c.id, sha256).select_from(tables) for sha256, tables in places]
    if session_id is not None:
        queries = [query.where(session.c.id == session_id) for query in queries]
    return {(row[0], row[1]) for row in c.execute(union(*queries)) if row[1] is not None}


def discard(db: Database, blobs: BlobStore, space: str, names: Iterable[str]) -> None:
    """Permanently remove files stored for a resource that has been erased meanwhile."""
    selected = sorted(set(names))
    for group in (
        selected[i : i + blobs.moved_at_once] for i in range(0, len(selected), blobs.moved_at_once)
    ):
        with db.write() as c:
            used = list_referenced(c)
            blobs.remove(space, *(name for name in group if (space, name) not in used))
