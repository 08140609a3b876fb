"""Comparison of orientation filters on a trial: request, run in the child, publish and read results."""

from __future__ import annotations

import datetime as dt
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from sqlalchemy import Connection, insert, select

from sagittal.core.fusion.algorithms.choice import require_filters
from sagittal.server import audit
from sagittal.server.errors import NotFound
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.jobs.queue import COMPARE_FILTERS, Claim, JobQueue, JobView
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.results import analyses, analysing, edit_log
from sagittal.server.results.shown_take import submit_on_shown
from sagittal.server.storage.files.blobs import Blob, BlobStore
from sagittal.server.storage.schema.tables import (
    analysis,
    filter_run,
    filter_run_file,
    new_id,
    now,
    recording,
    session,
)
from sagittal.server.uploads import reference_files

if TYPE_CHECKING:
    from sagittal.core.formats.source import SourceFile


ANALYSED: Final = 0.4
"""Fraction of a run at which the trial has been reanalysed and the filters begin."""


@dataclass(frozen=True)
class FilterRunRecord:
    """A finished comparison: filters, analysis, reference and result files."""

    id: str
    analysis_id: str
    session_id: str
    patient_id: str
    job_id: str
    settings: Mapping[str, Any]
    reference_name: str | None
    reference_sha256: str | None
    code_version: str
    created_at: dt.datetime
    files: Mapping[str, Blob]


def run(files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt) -> dict[str, bytes]:
    """Repeat the analysis of a trial, and run the filters on it; pure except for `attempt` and the clock.

    Parameters
    ----------
    files : of the recording, followed by the reference if `params` names one.

    Raises
    ------
    SagittalError
        the reference cannot be read, or no filter ran; code and message give the reason.
    """
    from sagittal.core.events.edits import read_edit
    from sagittal.core.events.result import Strides
    from sagittal.core.filter_comparison import FilterRequest, compare_filters
    from sagittal.core.formats.orientation_table import read_orientation_table
    from sagittal.core.parameters.measure import measure_gait
    from sagittal.server.report.files.filter_files import filter_run_files

    reference = None
    if params["reference"] is not None:
        *files, last = files
        reference = read_orientation_table(last.read(), last.name)
    take = analysing.analyse_again(files, params, attempt, ANALYSED)
    measured, edits = take.measured, [read_edit(e) for e in params["edits"]]
    if edits and take.tracks is not None:
        measured = measure_gait(take.tracks, edits)
    settings = params["settings"]
    result = compare_filters(
        take,
        Strides(()) if measured is None else measured.strides,
        FilterRequest(tuple(settings["filters"]), settings["magnetometer"]),
        lambda stage, share: attempt.progress(stage, ANALYSED + (1.0 - ANALYSED) * share),
        time.perf_counter,
        reference,
    )
    return filter_run_files(result)


def submit(
    c: Connection,
    queue: JobQueue,
    actor: audit.Actor | None,
    session_id: str,
    *,
    filters: Sequence[str],
    magnetometer: bool,
    reference: str | None = None,
) -> JobView:
    """Request a comparison for the displayed analysis, with its mapping, settings and edits.

    Parameters
    ----------
    filters : names. reference : name of one of the session's references.

    Raises
    ------
    NotFound
        the session, its analysis, or the reference. ParameterError: see `require_filters`.
    """
    require_filters(filters)
    record = analyses.get_shown(c, session_id)
    against = None if reference is None else reference_files.get(c, session_id, reference)
    return submit_on_shown(
        c,
        queue,
        actor,
        record,
        COMPARE_FILTERS,
        "filters.requested",
        against=against,
        edits=[e.to_json() for e in edit_log.edits_of(c, record.id).edits],
        settings={"filters": list(dict.fromkeys(filters)), "magnetometer": magnetometer},
        reference=None if against is None else {"name": against.name, "sha256": against.sha256},
    )


def publish(c: Connection, claim: Claim, files: Mapping[str, bytes], stored: Mapping[str, Blob]) -> None:
    """Store the rows of a result, in the transaction that marks its job done."""
    params, run_id = claim.params, new_id()
    reference = params["reference"] or {}
    row = {
        "id": run_id,
        "analysis_id": params["analysis_id"],
        "job_id": claim.job_id,
        "settings": params["settings"],
        "reference_name": reference.get("name"),
        "reference_sha256": reference.get("sha256"),
        "code_version": CODE_VERSION,
        "created_at": now(),
    }
    c.execute(insert(filter_run).values(row))
    for name, blob in stored.items():
        file = {"filter_run_id": run_id, "name": name, "size": blob.size, "sha256": blob.sha256}
        c.execute(insert(filter_run_file).values(file))


def get(c: Connection, run_id: str) -> FilterRunRecord:
    """One comparison; raises NotFound."""
    runs = _runs(c, _QUERY.where(filter_run.c.id == run_id))
    if not runs:
        raise NotFound("filter run", run_id)
    return runs[0]


def of_session(c: Connection, session_id: str) -> list[FilterRunRecord]:
    """All comparisons of a session, newest first."""
    newest = (filter_run.c.created_at.desc(), filter_run.c.id)
    return _runs(c, _QUERY.where(session.c.id == session_id).order_by(*newest))


def file_bytes(blobs: BlobStore, run: FilterRunRecord, name: str) -> bytes:
    """Read and verify a result file; raises NotFound, IntegrityError."""
    if name not in run.files:
        raise NotFound("file", name)
    return blobs.read(run.patient_id, run.files[name].sha256)


_QUERY = (
    select(filter_run, recording.c.session_id, session.c.patient_id)
    .join(analysis, analysis.c.id == filter_run.c.analysis_id)
    .join(recording, recording.c.id == analysis.c.recording_id)
    .join(session, session.c.id == recording.c.session_id)
)


def _runs(c: Connection, query: Any) -> list[FilterRunRecord]:
    rows = c.execute(query).all()
    files: dict[str, dict[str, Blob]] = {row.id: {} for row in rows}
    stored = select(filter_run_file).where(filter_run_file.c.filter_run_id.in_(files))
    for f in c.execute(stored.order_by(filter_run_file.c.name)) if files else ():
        files[f.filter_run_id][f.name] = Blob(f.sha256, f.size)
    return [FilterRunRecord(**row._asdict(), files=files[row.id]) for row in rows]
