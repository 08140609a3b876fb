"""Signed reports: assessment text, signing, reopening, and stored documents.

A signed report is stored with its hash and unaffected by later analyses. While one is in force, the text
cannot be changed and no other can be signed; reopening requires a reason.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Connection, delete, func, insert, select, update

from sagittal.core.message import Message
from sagittal.server import audit
from sagittal.server.clinic import sessions
from sagittal.server.errors import Conflict, NotFound, ServiceError
from sagittal.server.results.analyses import AnalysisRecord
from sagittal.server.results.edit_log import EditHistory
from sagittal.server.storage.files.blobs import Blob, BlobStore
from sagittal.server.storage.schema.report_tables import assessment, report_file, signed_report
from sagittal.server.storage.schema.tables import now, session

MOST_CHARACTERS: Final = 10_000
"""Maximum length of the reason for reopening a report."""
ASSESSMENT_CHARACTERS: Final = 420
"""Maximum length of the assessment, as many as fit on the first page next to the profile."""

DOCUMENT: Final = "report.html"
PSEUDONYMISED: Final = "shared.html"
PDF: Final = "report.pdf"


@dataclass(frozen=True)
class SignedReport:
    """One version of a session's report.

    Parameters
    ----------
    number : from 1. analysis_id : its analysis. signed_by, reopened_by : names at that time.
    reopened_at, reopened_because : when and why it was reopened, None while in force.
    sha256 : of the document.
    """

    id: str
    session_id: str
    number: int
    analysis_id: str
    language: str
    signed_by: str | None
    signed_at: dt.datetime
    reopened_by: str | None
    reopened_at: dt.datetime | None
    reopened_because: str | None
    sha256: str

    @property
    def in_force(self) -> bool:
        """Whether it has not been reopened."""
        return self.reopened_at is None


@dataclass(frozen=True)
class SignedDocuments:
    """A signed report with its files.

    Parameters
    ----------
    files : document, and PDF if rendered, by name.
    """

    report: SignedReport
    files: Mapping[str, Blob]

    def describe(self, record: AnalysisRecord, edits: EditHistory) -> dict[str, Any]:
        """Metadata for an archive or export of this analysis with these edits, as JSON.

        `of_these_numbers` is False if another analysis was signed or edits were made afterwards.
        """
        signed = self.report
        return {
            "version": signed.number,
            "language": signed.language,
            "signed_by": signed.signed_by,
            "signed_at": signed.signed_at.isoformat(timespec="seconds"),
            "sha256": signed.sha256,
            "of_these_numbers": signed.analysis_id == record.id and not edits.changed_after(signed.signed_at),
        }


@dataclass(frozen=True)
class Signature:
    """Signature as printed in a document."""

    report_id: str
    number: int
    name: str
    at: dt.datetime


def read_assessment(c: Connection, session_id: str) -> str:
    """The therapist's assessment, empty if there is none."""
    query = select(assessment.c.content).where(assessment.c.session_id == session_id)
    return c.execute(query).scalar_one_or_none() or ""


def write_assessment(c: Connection, actor: audit.Actor | None, session_id: str, content: str) -> None:
    """Set the therapist's assessment; raises NotFound, Conflict report_signed, ServiceError text_too_long."""
    sessions.get(c, session_id)
    require_open(c, session_id)
    text = content.strip()
    if len(text) > ASSESSMENT_CHARACTERS:
        raise ServiceError(
            "text_too_long",
            Message(
                "The assessment has {text} characters; at most {ASSESSMENT_CHARACTERS} fit. Nothing "
                "was changed.",
                text=len(text),
                ASSESSMENT_CHARACTERS=ASSESSMENT_CHARACTERS,
            ),
        )
    c.execute(delete(assessment).where(assessment.c.session_id == session_id))
    if text:
        c.execute(insert(assessment).values(session_id=session_id, content=text, changed_at=now()))
    audit.record(c, actor, "assessment.written", "session", session_id, {"characters": len(text)})


def require_open(c: Connection, session_id: str) -> None:
    """Raise Conflict report_signed while a signed report of the session is in force."""
    report = find_in_force(c, session_id)
    if report is not None:
        raise Conflict(
            "report_signed",
            Message(
                "Version {number} of this report is signed and locked. Reopen it first, with a reason.",
                number=report.number,
            ),
        )


def prepare_signature(c: Connection, session_id: str, report_id: str, name: str) -> Signature:
    """Signature to be printed in the next document; raises NotFound, Conflict report_signed."""
    sessions.get(c, session_id)
    require_open(c, session_id)
    newest = select(func.max(signed_report.c.number)).where(signed_report.c.session_id == session_id)
    return Signature(report_id, (c.execute(newest).scalar_one() or 0) + 1, name, now())


def keep_signed(
    c: Connection,
    actor: audit.Actor | None,
    signature: Signature,
    session_id: str,
    analysis_id: str,
    language: str,
    stored: Mapping[str, Blob],
) -> SignedReport:
    """Store a signed report with its documents.

    Raises
    ------
    NotFound
        the session. Conflict: signed by another user in the meantime, report_signed or report_changed.
    """
    expected = prepare_signature(c, session_id, signature.report_id, signature.name)
    if expected.number != signature.number:
        raise Conflict(
            "report_changed", "Another user has signed this report in the meantime. Reload the page."
        )
    c.execute(
        insert(signed_report).values(
            id=signature.report_id,
            session_id=session_id,
            number=signature.number,
            analysis_id=analysis_id,
            language=language,
            signed_by=signature.name,
            signed_at=signature.at,
        )
    )
    for name, blob in stored.items():
        _add_file(c, signature.report_id, name, blob)
    report = get(c, signature.report_id)
    detail = {"report_id": report.id, "version": report.number, "sha256": report.sha256}
    audit.record(c, actor, "signed_report.signed", "session", session_id, detail)
    return report


def reopen(c: Connection, actor: audit.Actor | None, report_id: str, reason: str, name: str) -> SignedReport:
    """Reopen a signed report, which remains readable. Raises NotFound, Conflict, bad_value."""
    report = get(c, report_id)
    if not report.in_force:
        raise Conflict(
            "not_in_force", Message("Version {number} has already been reopened.", number=report.number)
        )
    text = reason.strip()
    if not 1 <= len(text) <= MOST_CHARACTERS:
        raise ServiceError(
            "bad_value",
            Message("A reason has 1 to {MOST_CHARACTERS:,} characters.", MOST_CHARACTERS=MOST_CHARACTERS),
        )
    c.execute(
        update(signed_report)
        .where(signed_report.c.id == report_id)
        .values(reopened_by=name, reopened_at=now(), reopened_because=text)
    )
    detail = {"report_id": report_id, "version": report.number}
    audit.record(c, actor, "signed_report.reopened", "session", report.session_id, detail)
    return get(c, report_id)


def get(c: Connection, report_id: str) -> SignedReport:
    """One signed report; raises NotFound."""
    row = c.execute(_QUERY.where(signed_report.c.id == report_id)).first()
    if row is None:
        raise NotFound("signed report", report_id)
    return SignedReport(**row._asdict())


def of_session(c: Connection, session_id: str) -> list[SignedReport]:
    """All versions, newest first."""
    query = _QUERY.where(signed_report.c.session_id == session_id)
    return [SignedReport(**row._asdict()) for row in c.execute(query.order_by(signed_report.c.number.desc()))]


def find_in_force(c: Connection, session_id: str) -> SignedReport | None:
    """The version in force, None if nothing is signed or the last one was reopened."""
    return next((r for r in of_session(c, session_id) if r.in_force), None)


def find_documents(c: Connection, session_id: str) -> SignedDocuments | None:
    """The version in force with its document and PDF; None if nothing is signed."""
    query = (
        select(*_NAMES, report_file.c.name, report_file.c.sha256, report_file.c.size)
        .join(report_file, report_file.c.report_id == signed_report.c.id)
        .where(signed_report.c.session_id == session_id, signed_report.c.reopened_at.is_(None))
        .where(report_file.c.name.in_((DOCUMENT, PDF)))
        .order_by(report_file.c.name)
    )
    rows = list(c.execute(query))
    files = {row.name: Blob(row.sha256, row.size) for row in rows}
    if DOCUMENT not in files:
        return None
    values = {name: getattr(rows[0], name) for name in SignedReport.__dataclass_fields__ if name != "sha256"}
    return SignedDocuments(SignedReport(**values, sha256=files[DOCUMENT].sha256), files)


def find_file(c: Connection, report_id: str, name: str) -> tuple[str, str | None]:
    """Space and sha256 of a document of a signed report, None if it was not rendered; raises NotFound."""
    space = select(session.c.patient_id).where(session.c.id == get(c, report_id).session_id)
    query = select(report_file.c.sha256).where(
        report_file.c.report_id == report_id, report_file.c.name == name
    )
    return c.execute(space).scalar_one(), c.execute(query).scalar_one_or_none()


def read_document(c: Connection, blobs: BlobStore, report_id: str, name: str = DOCUMENT) -> bytes:
    """Read and verify a document stored at signing; raises NotFound, IntegrityError."""
    space, sha256 = find_file(c, report_id, name)
    if sha256 is None:
        raise NotFound("document of signed report", report_id)
    return blobs.read(space, sha256)


def keep_pdf(c: Connection, report_id: str, blob: Blob) -> None:
    """Store the PDF of a signed report, unless one is stored. Raises NotFound."""
    if find_file(c, report_id, PDF)[1] is None:
        _add_file(c, report_id, PDF, blob)


def _add_file(c: Connection, report_id: str, name: str, blob: Blob) -> None:
    c.execute(insert(report_file).values(report_id=report_id, name=name, size=blob.size, sha256=blob.sha256))


_NAMES: Final[tuple[Any, ...]] = tuple(
    signed_report.c[name] for name in SignedReport.__dataclass_fields__ if name != "sha256"
)
_QUERY: Final = select(*_NAMES, report_file.c.sha256).join(
    report_file, (report_file.c.report_id == signed_report.c.id) & (report_file.c.name == DOCUMENT)
)
