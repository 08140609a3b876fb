"""Which stored files the rows refer to."""

from __future__ import annotations

from sqlalchemy import Connection, select, union

from server.storage.tables import analysis, analysis_file, patient, recording, recording_file, session


def list_referenced(c: Connection, session_id: str | None = None) -> set[tuple[str, str]]:
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
