"""Exports of an analysis for other programs: offer, request, write in the child process, publish.

An export is stored as a file of its analysis, named by the job, and is deleted with it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from sqlalchemy import Connection, insert, select

from sagittal.core.events.edits import read_edit
from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import patients, sessions
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import Session
from sagittal.server.errors import Conflict
from sagittal.server.export import kinds
from sagittal.server.export.content import SignedForm, VisitFacts, open_content
from sagittal.server.export.kinds import EXPORTED, ExportKind, name_file
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.jobs.queue import EXPORT, VIEW_COLUMNS, Claim, JobQueue, JobView, job_view
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.results import analyses, edit_log
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.results.shown_take import make_key, submit_for
from sagittal.server.sharing import signed_reports
from sagittal.server.storage.files.blobs import Blob
from sagittal.server.storage.schema.tables import analysis_file, job

if TYPE_CHECKING:
    from sagittal.core.formats.source import SourceFile

SIGNED: Final = "signed-"
"""Prefix of the signed report's documents among the files of a job."""

MEDIA_TYPES: Final = {signed_reports.PDF: "application/pdf", signed_reports.DOCUMENT: "text/html"}
"""Of the documents of a signed report, the printable one first."""


@dataclass(frozen=True)
class ExportOffer:
    """A format in which the displayed analysis can be exported, in its current state.

    Parameters
    ----------
    kind : name. label, what : title and description. job : the export job, None = not requested since the
        last change.
    analysis_id, file : location for the download, file None until it is written.
    """

    kind: str
    label: str
    what: str
    job: JobView | None
    analysis_id: str
    file: str | None


def list_offers(
    c: Connection, patient: Patient, session: Session, record: analyses.AnalysisRecord
) -> list[ExportOffer]:
    """All formats in which an analysis of a session can be exported, and their progress.

    An export is offered again after an edit or a correction of patient or visit; formats that contain the
    signed report also after it was signed, reopened or printed.
    """
    possible = kinds.list_possible(record.files)
    params = _collect_params(c, patient, session, record, possible)
    keys = {name: make_key(record, EXPORT, own) for name, own in params.items()}
    query = select(*VIEW_COLUMNS, job.c.key).where(job.c.key.in_(keys.values())).order_by(job.c.seq)
    rows: list[Any] = list(c.execute(query))
    newest = {row.key: job_view(row) for row in rows}
    return [_offer(record, kind, newest.get(keys[kind.name])) for kind in possible]


def _offer(record: analyses.AnalysisRecord, kind: ExportKind, view: JobView | None) -> ExportOffer:
    name = None if view is None else name_file(kind, view.id)
    return ExportOffer(
        kind.name, kind.label, kind.what, view, record.id, name if name in record.files else None
    )


def submit(
    c: Connection, queue: JobQueue, actor: audit.Actor | None, session_id: str, *, kind: str
) -> JobView:
    """Request an export of the session's displayed analysis with the current edits; idempotent.

    Raises
    ------
    NotFound
        the session or its analysis. InputError unknown_export. Conflict export_not_possible.
    """
    chosen = kinds.find_kind(kind)
    record = analyses.get_shown(c, session_id)
    if chosen not in kinds.list_possible(record.files):
        lacking = ", ".join(name for name in chosen.needs if name not in record.files)
        raise Conflict(
            "export_not_possible",
            Message(
                "This analysis has no {lacking}, which “{label}” requires.",
                lacking=lacking,
                label=chosen.label,
            ),
        )
    session, patient = sessions.get(c, session_id), patients.get(c, record.patient_id)
    params = _collect_params(c, patient, session, record, [chosen])
    return submit_for(c, queue, actor, record, EXPORT, "export.requested", params[kind])


def run(files: Sequence[SourceFile], params: Mapping[str, Any], attempt: Attempt) -> dict[str, bytes]:
    """Write an export; pure, and too short for progress reports.

    Parameters
    ----------
    files : result files of the analysis, and documents of the signed report if the format includes it.

    Raises
    ------
    SagittalError
        it cannot be written; code and message give the reason.
    """
    readers = {file.name: file.read for file in files if not file.name.startswith(SIGNED)}
    edits = [read_edit(e) for e in params["edits"]]
    content = open_content(readers, VisitFacts.of_json(params["visit"]), edits)
    if params.get("signed") is not None:
        content = replace(content, signed=_read_signed(files, params["signed"]))
    return {params["kind"]: kinds.write_export(params["kind"], content)}


def publish(c: Connection, claim: Claim, files: Mapping[str, bytes], stored: Mapping[str, Blob]) -> None:
    """Store the file of a result, in the transaction that marks its job done."""
    for kind, blob in stored.items():
        name = name_file(kinds.find_kind(kind), claim.job_id)
        row = {"name": name, "size": blob.size, "sha256": blob.sha256}
        c.execute(insert(analysis_file).values(analysis_id=claim.params["analysis_id"], **row))


def _read_signed(files: Sequence[SourceFile], report: Mapping[str, Any]) -> SignedForm:
    """The signed report of a job, as specified by `_collect_params`."""
    readers = {file.name: file.read for file in files}
    documents = tuple(
        (media_type, readers[SIGNED + name]())
        for name, media_type in MEDIA_TYPES.items()
        if SIGNED + name in readers
    )
    fields = ("version", "language", "signed_by", "signed_at", "of_these_numbers")
    return SignedForm(**{name: report[name] for name in fields}, documents=documents)


def _collect_params(
    c: Connection,
    patient: Patient,
    session: Session,
    record: analyses.AnalysisRecord,
    formats: Sequence[ExportKind],
) -> dict[str, dict[str, Any]]:
    """Job parameters of each format by name, fixed at submission."""
    edits = edit_log.edits_of(c, record.id)
    shared: dict[str, Any] = {
        "space": record.patient_id,
        "files": [
            {"name": name, "size": blob.size, "sha256": blob.sha256}
            for name, blob in record.files.items()
            if not name.startswith(EXPORTED)
        ],
        "analysis_id": record.id,
        "edits": [e.to_json() for e in edits.edits],
        "visit": asdict(_describe_visit(patient, AnalysedSession(session, record, edits))),
    }
    params: dict[str, dict[str, Any]] = {kind.name: {**shared, "kind": kind.name} for kind in formats}
    handed_on = [kind.name for kind in formats if kind.hands_on_signed]
    signed = signed_reports.find_documents(c, session.id) if handed_on else None
    if signed is not None:
        documents = [
            {"name": SIGNED + name, "size": blob.size, "sha256": blob.sha256}
            for name, blob in signed.files.items()
        ]
        for name in handed_on:
            params[name] |= {
                "files": shared["files"] + documents,
                "signed": signed.describe(record, edits),
            }
    return params


def _describe_visit(patient: Patient, analysed: AnalysedSession) -> VisitFacts:
    session = analysed.session
    return VisitFacts(
        subject=make_pseudonym(patient.id),
        code=patient.code,
        visit=make_pseudonym(session.id),
        day=session.performed_on.isoformat(),
        protocol=session.protocol,
        sex=patient.sex,
        age_years=patient.find_age(session.performed_on),
        height_m=patient.find_height(session),
        affected_side=patient.affected_side,
        condition=analysed.condition.words,
        version=CODE_VERSION,
    )


def make_pseudonym(identity: str) -> str:
    """Stable pseudonym that cannot be resolved without the database: 12 hex digits."""
    return hashlib.sha256(identity.encode()).hexdigest()[:12]
