"""PDFs of self-contained documents, each rendered by its own process, one at a time."""

from __future__ import annotations

from typing import Final

import msgspec

from sagittal.server.errors import ServiceError
from sagittal.server.processes.errand import ErrandTurn, TooManyErrands, run_errand
from sagittal.server.report.pdf import PdfMissing
from sagittal.server.settings import Settings
from sagittal.server.sharing import signed_reports
from sagittal.server.sharing.paper_child import PaperReply
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import BlobStore

LONGEST_S: Final = 60.0
"""Time limit; a report takes some seconds."""

_turn = ErrandTurn()


class PdfFailed(ServiceError):  # noqa: N818 - says what failed
    """The PDF could not be created."""

    status = 503


def make_pdf(settings: Settings, document: bytes) -> bytes:
    """Render a self-contained document as PDF.

    Raises
    ------
    PdfMissing
        the library is not installed. PdfFailed: queue full, timeout, or the process died.
    """
    try:
        with _turn.take():
            answer = run_errand("sagittal.server.sharing.paper_child", settings, document, LONGEST_S)
    except TooManyErrands as error:
        raise PdfFailed("busy", "Other PDFs are being made. Try again in some seconds.") from error
    except TimeoutError as error:
        raise PdfFailed("pdf_failed", f"The PDF was not made within {LONGEST_S:.0f} s. Try again.") from error
    except (EOFError, OSError) as error:
        raise PdfFailed("pdf_failed", "The process that makes the PDF has ended. Try again.") from error
    reply = msgspec.msgpack.decode(answer, type=PaperReply)
    if reply.code == "pdf_missing":
        raise PdfMissing
    if reply.code:
        raise PdfFailed(reply.code, reply.message)
    return reply.content


def read_signed_pdf(db: Database, blobs: BlobStore, settings: Settings, report_id: str) -> bytes:
    """PDF of a signed report, rendered from its stored document at the first request and then stored.

    Raises
    ------
    NotFound, IntegrityError, PdfMissing, PdfFailed
    """
    with db.read() as c:
        space, sha256 = signed_reports.find_file(c, report_id, signed_reports.PDF)
        document = signed_reports.read_document(c, blobs, report_id)
    if sha256 is not None:
        return blobs.read(space, sha256)
    blob = blobs.put(space, make_pdf(settings, document))
    with db.write() as c:
        blobs.require(space, blob.sha256)
        signed_reports.keep_pdf(c, report_id, blob)
        space, sha256 = signed_reports.find_file(c, report_id, signed_reports.PDF)
    return blobs.read(space, sha256 or blob.sha256)
