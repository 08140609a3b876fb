"""PDFs of documents: what becomes of an answer, or of none."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from sqlalchemy import insert

from sagittal.server.errors import NotFound
from sagittal.server.processes.errand import MOST_WAITING
from sagittal.server.report.pdf import PdfMissing
from sagittal.server.settings import Settings
from sagittal.server.sharing import pdfs, signed_reports
from sagittal.server.sharing.paper_child import PaperReply
from sagittal.server.sharing.pdfs import PdfFailed, make_pdf, read_signed_pdf
from sagittal.server.storage.schema.report_tables import report_file, signed_report
from sagittal.server.storage.schema.tables import now
from tests.helpers.clinic import Clinic
from tests.server import feedback

PAGE = b"<html></html>"


class Child:
    """Stands for the process, whose library takes a second to import: its answer, or how it ended."""

    def __init__(self, said: PaperReply | Exception) -> None:
        self.said = said
        self.orders: list[tuple[str, bytes, float]] = []

    def run(self, module: str, settings: Settings, order: bytes, longest_s: float) -> bytes:
        self.orders.append((module, order, longest_s))
        if isinstance(self.said, Exception):
            raise self.said
        return msgspec.msgpack.encode(self.said)


def answering(monkeypatch: pytest.MonkeyPatch, message: PaperReply | Exception) -> Child:
    child = Child(message)
    monkeypatch.setattr(pdfs, "run_errand", child.run)
    return child


def test_the_document_goes_to_a_process_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    child = answering(monkeypatch, PaperReply(b"%PDF"))
    assert make_pdf(Settings(data_dir=tmp_path), PAGE) == b"%PDF"
    assert child.orders == [("sagittal.server.sharing.paper_child", PAGE, pdfs.LONGEST_S)]


@pytest.mark.parametrize(
    ("said", "code", "words"),
    [
        (TimeoutError(), "pdf_failed", "was not made within 60 s"),
        (EOFError(), "pdf_failed", "has ended"),
        (BrokenPipeError(), "pdf_failed", "has ended"),
        (PaperReply(code="internal_error", message="It could not."), "internal_error", "It could not."),
    ],
)
def test_no_answer_and_a_bad_one_are_failures_that_may_be_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said: PaperReply | Exception, code: str, words: str
) -> None:
    answering(monkeypatch, said)
    with pytest.raises(PdfFailed, match=words) as failed:
        make_pdf(Settings(data_dir=tmp_path), PAGE)
    assert (failed.value.code, failed.value.status) == (code, 503)


def test_a_library_that_is_not_there_is_no_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answering(monkeypatch, PaperReply(code="pdf_missing", message="None."))
    with pytest.raises(PdfMissing):
        make_pdf(Settings(data_dir=tmp_path), PAGE)


def test_who_would_wait_behind_too_many_is_told_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answering(monkeypatch, PaperReply(b"%PDF"))
    for _ in range(1 + MOST_WAITING):
        assert pdfs._turn._places.acquire(blocking=False)
    try:
        with pytest.raises(PdfFailed) as failed:
            make_pdf(Settings(data_dir=tmp_path), PAGE)
    finally:
        for _ in range(1 + MOST_WAITING):
            pdfs._turn._places.release()
    assert failed.value.code == "busy"
    assert make_pdf(Settings(data_dir=tmp_path), PAGE) == b"%PDF"


def test_the_pdf_of_a_signed_report_is_made_once_and_kept(
    stored: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    patient = feedback.person(stored)
    session, blobs = feedback.visit(stored, patient, 0), stored.app.state.blobs
    blob = blobs.put(patient, PAGE)
    with stored.db.write() as c:
        c.execute(
            insert(signed_report).values(
                id="r" * 32, session_id=session, number=1, analysis_id="a" * 32, language="en",
                signed_by="Ada", signed_at=now(),
            )
        )  # fmt: skip
        c.execute(
            insert(report_file).values(
                report_id="r" * 32, name=signed_reports.DOCUMENT, size=blob.size, sha256=blob.sha256
            )
        )
    child = answering(monkeypatch, PaperReply(b"%PDF of the report"))
    for _ in range(2):
        assert read_signed_pdf(stored.db, blobs, stored.settings, "r" * 32) == b"%PDF of the report"
    assert [order for _, order, _ in child.orders] == [PAGE]
    with pytest.raises(NotFound):
        read_signed_pdf(stored.db, blobs, stored.settings, "b" * 32)
