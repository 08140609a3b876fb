"""Analyses: request, publish and read results (for the computation see server/results/analysing.py)."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

from sqlalchemy import Connection, Result, Select, bindparam, func, insert, select, update

from sagittal.server import audit
from sagittal.server.clinic import sessions
from sagittal.server.errors import NotFound
from sagittal.server.jobs.queue import Claim, JobQueue, JobView
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.storage.files.blobs import Blob, BlobStore
from sagittal.server.storage.schema.columns import make_all
from sagittal.server.storage.schema.tables import (
    analysis,
    analysis_file,
    job,
    new_id,
    now,
    patient,
    recording,
    session,
)
from sagittal.server.uploads import recordings


@dataclass(frozen=True)
class AnalysisRecord:
    """A finished analysis: inputs, code version, and result files (name → stored bytes)."""

    id: str
    recording_id: str
    session_id: str
    patient_id: str
    job_id: str
    input_sha256: str
    config_sha256: str
    code_version: str
    manifest: Mapping[str, Any] | None
    config: Mapping[str, Any]
    created_at: dt.datetime
    files: Mapping[str, Blob]


def submit(
    c: Connection,
    queue: JobQueue,
    actor: audit.Actor | None,
    session_id: str,
    *,
    config: Mapping[str, Any] | None = None,
) -> JobView:
    """Request an analysis of the current recording with its latest manifest.

    Height and protocol are taken from the session (or the patient) if not in the manifest. Identical files,
    mapping, parameters and version are analysed only once, unless the analysis failed or the mapping changed.

    Raises
    ------
    Conflict
        no_files. NotFound: the session.
    """
    this = recordings.require_current(c, session_id)
    manifest = complete_manifest(c, session_id, this.manifest)
    chosen = dict(config or {})
    params = {**recordings.job_inputs(this), "manifest": manifest, "config": chosen}
    key = f"{this.id}:{recordings.ANALYSE}:{digest_json(params)}:{CODE_VERSION}"
    view = queue.submit(
        c,
        key=key,
        kind=recordings.ANALYSE,
        params=params,
        recording_id=this.id,
        requested_by=actor.user_id if actor else None,
    )
    c.execute(update(recording).where(recording.c.id == this.id).values(wanted_key=key))
    audit.record(c, actor, "analysis.requested", "session", session_id, {"job_id": view.id})
    return view


def publish(c: Connection, claim: Claim, stored: Mapping[str, Blob], config_sha256: str) -> None:
    """Store the rows of a result, in the transaction that marks its job done.

    Parameters
    ----------
    config_sha256 : digest of all parameters used, including defaults, from the result itself.
    """
    params = claim.params
    analysis_id = new_id()
    row = {
        "id": analysis_id,
        "recording_id": claim.recording_id,
        "job_id": claim.job_id,
        "input_sha256": params["input_sha256"],
        "config_sha256": config_sha256,
        "code_version": CODE_VERSION,
        "manifest": params["manifest"],
        "config": params["config"],
        "created_at": now(),
    }
    c.execute(insert(analysis).values(row))
    for name, blob in stored.items():
        file = {"analysis_id": analysis_id, "name": name, "size": blob.size, "sha256": blob.sha256}
        c.execute(insert(analysis_file).values(file))


def get(c: Connection, analysis_id: str) -> AnalysisRecord:
    """One analysis; raises NotFound."""
    records = _analyses(c, c.execute(_QUERY.where(analysis.c.id == analysis_id)))
    if not records:
        raise NotFound("analysis", analysis_id)
    return records[0]


def of_session(c: Connection, session_id: str) -> list[AnalysisRecord]:
    """All analyses of a session, the current one first: the last requested, otherwise the newest."""
    query = _QUERY.where(session.c.id == session_id).order_by(*_COUNTS_FIRST)
    return _analyses(c, c.execute(query))


def latest(c: Connection, session_id: str) -> AnalysisRecord | None:
    """The displayed analysis of a session, None before the first result."""
    return latest_of(c, [session_id]).get(session_id)


def latest_of(
    c: Connection,
    session_ids: Collection[str] | Select[tuple[str]],
    values: Mapping[str, object] = MappingProxyType({}),
) -> dict[str, AnalysisRecord]:
    """`latest` for many sessions, in two statements; sessions without a result are omitted.

    Parameters
    ----------
    session_ids : ids, or a statement that selects them. values : its parameters.
    """
    if isinstance(session_ids, Select):
        result = c.execute(_select_latest(session_ids), dict(values))
    else:
        result = c.execute(_select_latest(_IDS), {"session_ids": list(session_ids)})
    return {record.session_id: record for record in _analyses(c, result)}


@cache
def _select_latest(session_ids: Select[tuple[str]]) -> Select[Any]:
    place = func.row_number().over(partition_by=session.c.id, order_by=_COUNTS_FIRST).label("place")
    ranked = _joined(select(analysis.c.id, place)).where(session.c.id.in_(session_ids)).subquery()
    return _QUERY.where(analysis.c.id.in_(select(ranked.c.id).where(ranked.c.place == 1)))


def get_shown(c: Connection, session_id: str) -> AnalysisRecord:
    """The displayed analysis of a session; raises NotFound if there is no session or result."""
    sessions.get(c, session_id)
    record = latest(c, session_id)
    if record is None:
        raise NotFound("analysis of visit", session_id)
    return record


def file_bytes(blobs: BlobStore, record: AnalysisRecord, name: str) -> bytes:
    """Read and verify a result file; raises NotFound, IntegrityError."""
    if name not in record.files:
        raise NotFound("file", name)
    return blobs.read(record.patient_id, record.files[name].sha256)


def _joined(query: Select[Any]) -> Select[Any]:
    return (
        query.join(recording, recording.c.id == analysis.c.recording_id)
        .join(session, session.c.id == recording.c.session_id)
        .join(job, job.c.id == analysis.c.job_id)
    )


_QUERY = _joined(select(analysis, recording.c.session_id, session.c.patient_id))
_COUNTS_FIRST = (
    recording.c.created_at.desc(),
    (job.c.key == recording.c.wanted_key).desc(),
    analysis.c.created_at.desc(),
    analysis.c.id,
)


_IDS = select(session.c.id).where(session.c.id.in_(bindparam("session_ids", expanding=True)))
_FILES = (
    select(*(analysis_file.c[name] for name in ("analysis_id", "name", "sha256", "size")))
    .where(analysis_file.c.analysis_id.in_(bindparam("analysis_ids", expanding=True)))
    .order_by(analysis_file.c.name)
)


def _analyses(c: Connection, result: Result[Any]) -> list[AnalysisRecord]:
    """Analyses with their files, read in one statement."""
    files: defaultdict[str, dict[str, Blob]] = defaultdict(dict)
    records = make_all(lambda **row: AnalysisRecord(**row, files=files[row["id"]]), result)
    for analysis_id, name, sha256, size in c.execute(_FILES, {"analysis_ids": list(files)}) if files else ():
        files[analysis_id][name] = Blob(sha256, size)
    return records


def complete_manifest(c: Connection, session_id: str, manifest: Mapping[str, Any] | None) -> dict[str, Any]:
    """Complete a manifest with height and protocol of the session (or the patient)."""
    completed = dict(manifest or {})
    row = c.execute(
        select(session.c.protocol, session.c.height_m, patient.c.height_m.label("usual_height_m"))
        .join(patient, patient.c.id == session.c.patient_id)
        .where(session.c.id == session_id)
    ).one()
    height = row.height_m if row.height_m is not None else row.usual_height_m
    subject = dict(completed.get("subject") or {})
    if subject.get("height_m") is None and height is not None:
        subject["height_m"] = height
    if subject:
        completed["subject"] = subject
    if completed.get("protocol") is None:
        completed["protocol"] = row.protocol
    return completed


def digest_json(value: object) -> str:
    """SHA-256 of a value as JSON, independent of key order."""
    text = json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
