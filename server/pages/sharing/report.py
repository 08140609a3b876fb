"""A session's report as a document: PDF, signing, versions, and links."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse
from starlette.responses import Response

from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.auth.sight import find_emergency
from sagittal.server.context import Blobs, Config, Db, Failures, Id, OpenTrail, Reviewed, address_of
from sagittal.server.errors import NotFound
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.http.templates import language_of
from sagittal.server.pages.clinic.identity import name_on_paper
from sagittal.server.pages.results.session import PAPER, choose_template, gather_report
from sagittal.server.pages.results.session_context import read_context
from sagittal.server.pages.sharing.paper import (
    hide_person,
    print_pdf,
    show_document,
    show_pdf,
    write_document,
)
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.results import analyses
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.sharing import pdfs, report_links, signed_reports
from sagittal.server.sharing.report_links import LinkNotFound
from sagittal.server.sharing.signed_reports import DOCUMENT, PSEUDONYMISED
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import new_id

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse, route_class=StrictJsonRoute)

SHARED = "report_link"
"""Throttle key for guesses of report links."""

Reader = Annotated[Identity, require(Action.READ_RESULT)]


@router.get("/sessions/{sid}/report")
def show_desk(request: Request, db: Db, sid: Id, user: Reader) -> Response:
    """Assessment text, signing, signed versions and their links."""
    with db.read() as c:
        context = read_context(c, sid)
        if analyses.latest(c, sid) is None:
            return RedirectResponse(f"/sessions/{sid}", status_code=303)
        context["assessment"] = signed_reports.read_assessment(c, sid)
        context["versions"] = signed_reports.of_session(c, sid)
        context["in_force"] = next((r for r in context["versions"] if r.in_force), None)
        context["links"] = report_links.of_session(c, sid)
        context["emergency"] = find_emergency(c, user, context["patient"].id)
    context["numbers"] = {r.id: r.number for r in context["versions"]}
    context |= {
        "usual_days": report_links.USUAL_DAYS,
        "most_days": report_links.MOST_DAYS,
        "most_characters": signed_reports.ASSESSMENT_CHARACTERS,
    }
    record_opening(request, user, "session", sid)
    return render_page(request, db, user, "report.html", "patients", **context)


@router.get("/sessions/{sid}/report.pdf")
def make_draft(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    trail: OpenTrail,
    settings: Config,
    sid: Id,
    user: Reader,
    named: bool = False,
) -> Response:
    """Current report as PDF, marked as unsigned, with the patient's name if requested."""
    context = _gather(db, reviewed, sid, user)
    trail.record_opened(user, "report.opened", "session", sid)
    context |= name_on_paper(request, db, settings, user, context["patient"].id, named=named)
    return print_pdf(request, settings, choose_template(PAPER, context), context, f"report-{sid[:8]}.pdf")


@router.post("/sessions/{sid}/report/sign", status_code=201, response_class=JSONResponse)
def sign(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    blobs: Blobs,
    sid: Id,
    user: Annotated[Identity, require(Action.SIGN_REPORT)],
) -> dict[str, str]:
    """Sign the current report: its document is created once, stored and locked."""
    report_id, language = new_id(), language_of(request)
    with db.read() as c:
        signature = signed_reports.prepare_signature(c, sid, report_id, user.display_name)
    context = _gather(db, reviewed, sid, user) | {"signature": signature}
    contexts = {DOCUMENT: context, PSEUDONYMISED: hide_person(context, f"R-{report_id[:8]}")}
    template = choose_template(PAPER, context)
    written = {name: write_document(language, template, each) for name, each in contexts.items()}
    space = context["session"].patient_id
    stored = {name: blobs.put(space, content) for name, content in written.items()}
    with db.write() as c:
        for blob in stored.values():
            blobs.require(space, blob.sha256)
        analysis_id = context["analysis"].id
        report = signed_reports.keep_signed(c, user, signature, sid, analysis_id, language, stored)
    return {"id": report.id, "sha256": report.sha256}


@router.get("/signed-reports/{report_id}")
def show_signed(db: Db, blobs: Blobs, trail: OpenTrail, report_id: Id, user: Reader) -> Response:
    """A signed report, exactly as signed."""
    with db.read() as c:
        session_id = signed_reports.get(c, report_id).session_id
        content = signed_reports.read_document(c, blobs, report_id)
    trail.record_opened(user, "signed_report.opened", "session", session_id, {"report_id": report_id})
    return show_document(content)


@router.get("/signed-reports/{report_id}/report.pdf")
def show_signed_pdf(
    db: Db, blobs: Blobs, trail: OpenTrail, settings: Config, report_id: Id, user: Reader
) -> Response:
    """The signed report as PDF."""
    with db.read() as c:
        report = signed_reports.get(c, report_id)
    trail.record_opened(user, "signed_report.opened", "session", report.session_id, {"report_id": report_id})
    content = pdfs.read_signed_pdf(db, blobs, settings, report_id)
    return show_pdf(content, f"report-{report.session_id[:8]}-version-{report.number}.pdf")


@router.get("/r/{token}", dependencies=[require(Action.READ_SHARED)])
def show_shared(
    request: Request, db: Db, blobs: Blobs, trail: OpenTrail, throttle: Failures, token: str
) -> Response:
    """The report of a link, without the patient's code."""
    address = address_of(request)
    guessed = f"{SHARED} {address}"  # guesses from other addresses do not block this one
    try:
        with db.read() as c:
            link = report_links.find_by_token(c, token)
    except LinkNotFound:
        # failures only: a valid link works regardless of guesses from the same address
        throttle.begin(guessed, address)
        trail.record_refused("report_link.refused", "session", None, address)
        raise
    report_links.note_opening(db, link, address)
    with db.read() as c:
        content = signed_reports.read_document(c, blobs, link.report_id, PSEUDONYMISED)
    return show_document(content, is_shared=True)


def _gather(db: Database, reviewed: ReviewedAnalyses, sid: str, user: Identity) -> dict[str, Any]:
    context = gather_report(db, reviewed, sid, user, PAPER)
    if context["report"] is None:
        raise NotFound("analysis of visit", sid)
    return context
