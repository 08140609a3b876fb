"""Removing stored files that no row refers to: cut uploads, results of lost claims, replaced files.

A file may be young because somebody is about to refer to it, so only files older than a grace time go. They
go while the write lock is held: a publisher either has committed (the reference is seen) or will find its
file gone in its own transaction (BlobStore.require) and fail cleanly.
"""

from __future__ import annotations

from sqlalchemy import Connection, select, union

from server.storage.blobs import BlobStore
from server.storage.db import Database
from server.storage.tables import analysis, analysis_file, patient, recording, recording_file, session


def sweep(db: Database, blobs: BlobStore, *, grace_s: float, only: set[tuple[str, str]] | None = None) -> int:
    """Remove unreferenced files older than `grace_s`, of `only` these addresses or all; return how many."""
    old = [f for f in blobs.files() if f.age_s >= grace_s and (only is None or (f.space, f.name) in only)]
    if not old:
        return 0
    removed = 0
    with db.write() as c:
        used = referenced(c)
        for stored in old:
            if (stored.space, stored.name) not in used and stored.is_older(grace_s):
                blobs.remove(stored)
                removed += 1
    return removed


def referenced(c: Connection, session_id: str | None = None) -> set[tuple[str, str]]:
    """Every (space, sha256) that a row refers to, of one session or all."""
    originals = (
        select(patient.c.id, recording_file.c.sha256)
        .join(session, session.c.patient_id == patient.c.id)
        .join(recording, recording.c.session_id == session.c.id)
        .join(recording_file, recording_file.c.recording_id == recording.c.id)
    )
    results = (
        select(patient.c.id, analysis_file.c.sha256)
        .join(session, session.c.patient_id == patient.c.id)
        .join(recording, recording.c.session_id == session.c.id)
        .join(analysis, analysis.c.recording_id == recording.c.id)
        .join(analysis_file, analysis_file.c.analysis_id == analysis.c.id)
    )
    if session_id is not None:
        originals = originals.where(session.c.id == session_id)
        results = results.where(session.c.id == session_id)
    return {(row[0], row[1]) for row in c.execute(union(originals, results))}
