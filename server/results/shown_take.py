"""Jobs on a session's displayed analysis: on its recording as analysed, or on its result files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection

from sagittal.server import audit
from sagittal.server.jobs.queue import JobQueue, JobView
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.results import analyses
from sagittal.server.uploads import recordings


def submit_on_shown(
    c: Connection,
    queue: JobQueue,
    actor: audit.Actor | None,
    record: analyses.AnalysisRecord,
    kind: str,
    action: str,
    *,
    against: recordings.RecordedFile | None,
    **own: Any,
) -> JobView:
    """Request a job on the displayed analysis; idempotent.

    Parameters
    ----------
    record : the displayed analysis. action : in the audit log. against : a reference, added as last file of
        the job. own : parameters specific to this kind of job.
    """
    inputs = recordings.job_inputs(recordings.get(c, record.recording_id))
    if against is not None:
        inputs["files"].append({"name": against.name, "size": against.size, "sha256": against.sha256})
    params = {
        **inputs,
        "manifest": record.manifest or {},
        "config": dict(record.config),
        "analysis_id": record.id,
        **own,
    }
    return submit_for(c, queue, actor, record, kind, action, params)


def submit_for(
    c: Connection,
    queue: JobQueue,
    actor: audit.Actor | None,
    analysis_record: analyses.AnalysisRecord,
    kind: str,
    action: str,
    params: Mapping[str, Any],
) -> JobView:
    """Request a job on an analysis; idempotent."""
    view = queue.submit(
        c,
        key=make_key(analysis_record, kind, params),
        kind=kind,
        params=params,
        recording_id=analysis_record.recording_id,
        requested_by=actor.user_id if actor else None,
    )
    audit.record(c, actor, action, "session", analysis_record.session_id, {"job_id": view.id})
    return view


def make_key(record: analyses.AnalysisRecord, kind: str, params: Mapping[str, Any]) -> str:
    """Key of a job on an analysis: equal keys give equal results."""
    return f"{record.id}:{kind}:{analyses.digest_json(params)}:{CODE_VERSION}"
