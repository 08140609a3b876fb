"""Sensitivity analyses of squats: request, run in the child, and read results.

Results are stored as files of the underlying analysis, named by the job, and deleted with it.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from sqlalchemy import Connection, insert, select

from sagittal.core.errors import EstimationError, InputError
from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import sessions
from sagittal.server.errors import Conflict, NotFound
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.jobs.queue import SENSITIVITY, Claim, JobQueue, JobView
from sagittal.server.report.files.bundle import read_angles
from sagittal.server.report.view.sensitivity import sensitivity_files, summarise_sensitivity
from sagittal.server.results import analyses, analysing
from sagittal.server.results.shown_take import submit_on_shown
from sagittal.server.storage.files.blobs import Blob
from sagittal.server.storage.schema.tables import analysis_file, job, recording
from sagittal.server.uploads import reference_files

if TYPE_CHECKING:
    from sagittal.core.formats.source import SourceFile
    from sagittal.core.squat.sensitivity import ReferenceAngles

ANALYSED: Final = 0.3
"""Fraction of a run at which the trial has been reanalysed and the 24 parameters begin."""

TABLE: Final = ".parquet"
"""Extension of a reference with joint angles."""


@dataclass(frozen=True)
class StoredSensitivity:
    """A finished sensitivity analysis; `id` is that of its job.

    Parameters
    ----------
    reference : name of the reference for errors; None = changes relative to the trial's own angles.
    from_standing : angles are relative to standing, as on the session's pages; otherwise anatomical.
    files : names among the files of the analysis.
    """

    id: str
    session_id: str
    analysis_id: str
    reference: str | None
    from_standing: bool
    files: tuple[str, ...]
    created_at: dt.datetime


def read_reference(content: bytes, name: str, *, from_standing: bool) -> ReferenceAngles:
    """Angles of an angles.parquet, relative to standing or anatomical.

    Raises
    ------
    InputError `reference_unreadable`.
    """
    from sagittal.core.squat.sensitivity import ReferenceAngles

    try:
        angles = read_angles(content)
    except (KeyError, ValueError, OSError) as error:
        raise InputError(
            "reference_unreadable",
            Message("“{name}” is not the angles.parquet of an analysis or a simulation.", name=name),
        ) from error
    offset: Mapping[str, float] = {} if from_standing else angles.zero_offset
    by_name = {n: values + offset.get(n, 0.0) for n, values in angles.angles.items()}
    return ReferenceAngles(angles.t_s, by_name)


def run(files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt) -> dict[str, bytes]:
    """Repeat the analysis of a trial, and perturb every parameter; pure except for `attempt`.

    Parameters
    ----------
    files : of the recording, followed by the reference if `params` names one.

    Raises
    ------
    SagittalError
        the trial has no tracked squats, or the reference cannot be read or does not match.
    """
    from sagittal.core.body.chain.geometry import LegGeometry
    from sagittal.core.squat.sensitivity import analyse_legs

    settings, reference = params["settings"], None
    if settings["reference"] is not None:
        *files, last = files
        reference = read_reference(last.read(), last.name, from_standing=settings["from_standing"])
    take = analysing.analyse_again(files, params, attempt, ANALYSED)
    if take.calibrated is None or take.legs is None:
        reason = "" if take.problem is None else f" {take.problem.message}"
        raise EstimationError(
            "no_squats", Message("The legs could not be tracked in this trial.{reason}", reason=reason)
        )
    height = take.recording.subject.height_m
    tables = analyse_legs(
        take.calibrated,
        [LegGeometry.from_height(height, side) for side in take.legs],
        reference,
        from_standing=settings["from_standing"],
        params=take.config.squat.chain,
        progress=lambda _, share: attempt.progress("parameters", ANALYSED + (1.0 - ANALYSED) * share),
    )
    summary = summarise_sensitivity(tables, settings["reference"], from_standing=settings["from_standing"])
    return sensitivity_files(summary, "sensitivity")


def submit(
    c: Connection,
    queue: JobQueue,
    actor: audit.Actor | None,
    session_id: str,
    *,
    reference: str | None = None,
    from_standing: bool = True,
) -> JobView:
    """Request an analysis for the displayed one, with its mapping and settings; idempotent.

    Parameters
    ----------
    reference : name of one of the session's references, an angles.parquet.

    Raises
    ------
    NotFound
        the session, its analysis, or the reference. Conflict: not_squats.
    """
    if sessions.get(c, session_id).protocol != "squat":
        raise Conflict("not_squats", "This analysis is for squats; the visit has another protocol.")
    record = analyses.get_shown(c, session_id)
    against = None if reference is None else reference_files.get(c, session_id, reference)
    settings = {"reference": reference, "from_standing": from_standing}
    return submit_on_shown(
        c, queue, actor, record, SENSITIVITY, "sensitivity.requested", against=against, settings=settings
    )


def publish(c: Connection, claim: Claim, files: Mapping[str, bytes], stored: Mapping[str, Blob]) -> None:
    """Store the files of a result, in the transaction that marks its job done."""
    for name, blob in stored.items():
        row = {"name": _name(claim.job_id, name), "size": blob.size, "sha256": blob.sha256}
        c.execute(insert(analysis_file).values(analysis_id=claim.params["analysis_id"], **row))


def get(c: Connection, job_id: str) -> StoredSensitivity:
    """One finished analysis; raises NotFound."""
    row = c.execute(_QUERY.where(job.c.id == job_id)).first()
    if row is None:
        raise NotFound("sensitivity analysis", job_id)
    return _stored(row)


def of_session(c: Connection, session_id: str) -> list[StoredSensitivity]:
    """All finished analyses, newest first; raises NotFound for the session."""
    sessions.get(c, session_id)
    rows = c.execute(_QUERY.where(recording.c.session_id == session_id).order_by(job.c.finished_at.desc()))
    return [_stored(row) for row in rows]


def find_file(c: Connection, stored: StoredSensitivity) -> tuple[analyses.AnalysisRecord, str]:
    """The analysis that stores the result, and the name of its JSON."""
    return analyses.get(c, stored.analysis_id), stored.files[0]


def _name(job_id: str, name: str) -> str:
    stem, dot, ending = name.rpartition(".")
    return f"{stem}-{job_id[:8]}{dot}{ending}"


def _stored(row: Any) -> StoredSensitivity:
    settings = row.params["settings"]
    return StoredSensitivity(
        id=row.id,
        session_id=row.session_id,
        analysis_id=row.params["analysis_id"],
        reference=settings["reference"],
        from_standing=settings["from_standing"],
        files=tuple(_name(row.id, f"sensitivity.{ending}") for ending in ("json", "csv")),
        created_at=row.finished_at,
    )


_QUERY = (
    select(job.c.id, job.c.params, job.c.finished_at, recording.c.session_id)
    .join(recording, recording.c.id == job.c.recording_id)
    .where(job.c.kind == SENSITIVITY, job.c.state == "done")
)
