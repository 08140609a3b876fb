"""Assessment text of a report, signed versions, and links to them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import segno
from fastapi import APIRouter, Request

from sagittal.server.api import schemas
from sagittal.server.api.documents import refusals
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import sessions
from sagittal.server.context import Db, Id, OpenTrail
from sagittal.server.http.json_body import StrictJsonRoute
from sagittal.server.sharing import report_links, signed_reports
from sagittal.server.sharing.report_links import ReportLink
from sagittal.server.sharing.signed_reports import SignedReport

router = APIRouter(route_class=StrictJsonRoute, tags=["report"])
Reader = Annotated[Identity, require(Action.READ_RESULT)]
Signer = Annotated[Identity, require(Action.SIGN_REPORT)]


@dataclass(frozen=True)
class NewReportLink:
    """A newly created link; its URL is shown only once.

    Parameters
    ----------
    url : for the recipient. qr : QR code of it as a data URL, `data:image/svg+xml`.
    """

    link: ReportLink
    url: str
    qr: str


@router.put("/sessions/{session_id}/assessment", status_code=204, responses=refusals(409))
def write_assessment(session_id: Id, body: schemas.Assessment, db: Db, user: Signer) -> None:
    """Set the therapist's assessment on the report; empty = none."""
    with db.write() as c:
        signed_reports.write_assessment(c, user, session_id, body.content or "")


@router.get("/sessions/{session_id}/signed-reports", response_model=list[SignedReport])
def list_signed(session_id: Id, db: Db, trail: OpenTrail, user: Reader) -> list[SignedReport]:
    """List all signed versions, newest first."""
    with db.read() as c:
        sessions.get(c, session_id)
        rows = signed_reports.of_session(c, session_id)
    trail.record_opened(user, "signed_reports.opened", "session", session_id)
    return rows


@router.post("/signed-reports/{report_id}/reopen", response_model=SignedReport, responses=refusals(409))
def reopen(report_id: Id, body: schemas.Reopening, db: Db, user: Signer) -> SignedReport:
    """Reopen a signed report with a reason, and end its links; the version remains readable."""
    with db.write() as c:
        return report_links.reopen_report(c, user, report_id, body.reason, user.display_name)


@router.get("/sessions/{session_id}/report-links", response_model=list[ReportLink])
def list_links(session_id: Id, db: Db, trail: OpenTrail, user: Reader) -> list[ReportLink]:
    """List links to the signed reports of a session, newest first, without their URLs."""
    with db.read() as c:
        sessions.get(c, session_id)
        rows = report_links.of_session(c, session_id)
    trail.record_opened(user, "signed_reports.opened", "session", session_id)
    return rows


@router.post(
    "/signed-reports/{report_id}/links",
    status_code=201,
    response_model=NewReportLink,
    responses=refusals(409),
)
def make_link(
    report_id: Id, body: schemas.ReportLinkNew, request: Request, db: Db, user: Signer
) -> NewReportLink:
    """Create a link to this report, without the patient's code, for a reader without an account."""
    with db.write() as c:
        link, token = report_links.make(c, user, report_id, body.days, user.display_name)
    url = f"{request.base_url}r/{token}"
    return NewReportLink(link, url, segno.make(url, micro=False).svg_data_uri(scale=4, border=2))


@router.delete("/report-links/{link_id}", response_model=ReportLink)
def revoke_link(link_id: Id, db: Db, user: Signer) -> ReportLink:
    """End a link immediately."""
    with db.write() as c:
        return report_links.revoke(c, user, link_id)
