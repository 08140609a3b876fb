"""The pages: server-made HTML over the same services as the API; every change goes through the API itself."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.responses import Response

from core.condition import USUAL
from server import audit, page_views, prescription_views, session_views, upload_views, visit_views
from server.auth import accounts, one_time
from server.auth.access import require
from server.auth.identity import Identity
from server.auth.passwords import MIN_LENGTH
from server.auth.roles import Action, Role
from server.context import Blobs, Db, Id, OpenTrail
from server.http.problems import TEMPLATES
from server.services import (
    analyses,
    comparisons,
    feedback,
    histories,
    patients,
    prescriptions,
    programmes,
    recordings,
    reviews,
    sessions,
    signals,
)
from server.shell import listed as _listed
from server.shell import opened as _opened
from server.shell import page as _page
from server.storage.blobs import BlobStore
from server.storage.db import Database
from server.storage.tables import now

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

PATIENTS_SHOWN = 200
AUDIT_ROWS = 100
FRAGMENT = "x-sagittal-fragment"
"""Header by which the page's own script asks for a part of it."""


@router.get("/")
def home(who: Annotated[Identity, require(Action.READ_PATIENT)]) -> Response:
    """Go to the patients."""
    return RedirectResponse("/patients", status_code=303)


@router.get("/sign-in", dependencies=[require(Action.SIGN_IN)])
def sign_in(request: Request, next: Annotated[str, Query(max_length=2000)] = "/patients") -> Response:  # noqa: A002 - the name in the address
    """Ask for name and password."""
    local = next if next.startswith("/") and next[1:2] not in {"/", "\\"} else "/patients"
    return TEMPLATES.TemplateResponse(request, "sign-in.html", {"next": local})


@router.get("/set-up/{token}", dependencies=[require(Action.SET_UP)])
def set_up(request: Request, db: Db, token: str) -> Response:
    """Make the first account, from the address printed at the first start."""
    with db.read() as c:
        valid = one_time.is_valid(c, token, "set_up")
    context = {"token": token, "valid": valid, "min_password": MIN_LENGTH}
    return TEMPLATES.TemplateResponse(request, "set-up.html", context, status_code=200 if valid else 404)


@router.get("/patients")
def patient_list(
    request: Request,
    db: Db,
    blobs: Blobs,
    who: Annotated[Identity, require(Action.READ_PATIENT)],
    q: Annotated[str, Query(max_length=200)] = "",
) -> Response:
    """All patients, the latest visit first."""
    with db.read() as c:
        found = patients.listing(c, search=q, limit=PATIENTS_SHOWN)
        rows = page_views.patient_rows(c, blobs, found, results=who.may(Action.READ_RESULT))
        total = page_views.patient_count(c)
    _listed(request, who, "patient")
    return _page(request, db, who, "patients.html", "patients", patients=rows, query=q, total=total)


@router.get("/patients/{pid}")
def patient_page(
    request: Request, db: Db, blobs: Blobs, pid: Id, who: Annotated[Identity, require(Action.READ_PATIENT)]
) -> Response:
    """One patient: programme, the trend of one figure, results by visit."""
    with db.read() as c:
        patient = patients.get(c, pid)
        visits = page_views.visits(c, blobs, pid, results=who.may(Action.READ_RESULT))
        done, plans = histories.read(c, patient)
        written = prescriptions.of_patient(c, pid) if who.may(Action.READ_RESULT) else []
    _opened(request, who, "patient", pid)
    trend = None
    if who.may(Action.READ_RESULT):
        trend = visit_views.teaser(histories.history(blobs, patient, done, plans))
    return _page(
        request, db, who, "patient.html", "patients",
        patient=page_views.patient_view(patient), visits=visits, keys=page_views.KEY_PARAMETERS,
        programme=visit_views.programme_view(plans[0], now().date()) if plans else None,
        planned={v.session_id: v.label for plan in plans for v in plan.visits if v.session_id},
        trend=trend, comparable=len(done) > 1, feedback=prescription_views.card(written),
    )  # fmt: skip


@router.get("/patients/{pid}/sessions/new")
def new_session(
    request: Request, db: Db, pid: Id, who: Annotated[Identity, require(Action.CREATE_SESSION)]
) -> Response:
    """Ask for protocol, date, height and walking condition of a new visit."""
    today = now().date()
    with db.read() as c:
        patient = patients.get(c, pid)
        plans = programmes.of_patient(c, pid)
    _opened(request, who, "patient", pid)
    open_visits = [v for plan in plans[:1] for v in plan.visits if v.session_id is None]
    return _page(
        request, db, who, "session-new.html", "patients",
        patient=patient, protocols=page_views.PROTOCOLS, today=today.isoformat(), open_visits=open_visits,
        near=plans[0].near(today) if plans else None, usual=USUAL,
    )  # fmt: skip


@router.get("/sessions/{sid}/upload")
def upload(
    request: Request, db: Db, sid: Id, who: Annotated[Identity, require(Action.READ_SESSION)]
) -> Response:
    """Upload files, see what was found in them, say which sensor is where."""
    with db.read() as c:
        session = sessions.get(c, sid)
        patient = patients.get(c, session.patient_id)
        view = upload_views.upload_view(c, recordings.current(c, sid), session, patient)
    _opened(request, who, "session", sid)
    return _page(request, db, who, "upload.html", "patients", session=session, patient=patient, **view)


@router.get("/sessions/{sid}")
def overview(
    request: Request, db: Db, blobs: Blobs, sid: Id, who: Annotated[Identity, require(Action.READ_SESSION)]
) -> Response:
    """Is the data good, how does this person walk."""
    return _session_page(request, db, blobs, sid, who, "session.html")


@router.get("/sessions/{sid}/kinematics")
def kinematics(
    request: Request, db: Db, blobs: Blobs, sid: Id, who: Annotated[Identity, require(Action.READ_RESULT)]
) -> Response:
    """All cycle curves with the replay."""
    return _session_page(request, db, blobs, sid, who, "kinematics.html")


@router.get("/sessions/{sid}/timeline")
def timeline(
    request: Request, db: Db, blobs: Blobs, sid: Id, who: Annotated[Identity, require(Action.READ_RESULT)]
) -> Response:
    """Strides, events and signals over time, to look at and to correct."""
    with db.read() as c:
        context = session_views.base(c, sid)
        latest = analyses.latest(c, sid)
        edits = reviews.Edits() if latest is None else reviews.edits_of(c, latest.id)
    if latest is not None:
        context["numbers"] = session_views.numbers(blobs, latest, edits, context)
        context["lanes"] = [vars(lane) for lane in signals.lanes(blobs, latest)]
        context["fixed_because"] = reviews.take(blobs, latest).fixed_because
        context["editable"] = context["fixed_because"] is None and who.may(Action.REVIEW)
    _opened(request, who, "session", sid)
    return _page(request, db, who, "timeline.html", "patients", **context)


@router.get("/sessions/{sid}/timeline/numbers")
def timeline_numbers(
    request: Request,
    db: Db,
    blobs: Blobs,
    trail: OpenTrail,
    sid: Id,
    who: Annotated[Identity, require(Action.READ_RESULT)],
) -> Response:
    """The part of the timeline page that follows an edit; asked for in another way, the page itself."""
    if FRAGMENT not in request.headers:
        return RedirectResponse(f"/sessions/{sid}/timeline#numbers", status_code=303)
    with db.read() as c:
        context = session_views.base(c, sid)
        latest = analyses.shown(c, sid)
        edits = reviews.edits_of(c, latest.id)
    trail.watched(who, "numbers.opened", "session", sid)
    numbers = session_views.numbers(blobs, latest, edits, context)
    return TEMPLATES.TemplateResponse(request, "_numbers.html", {"numbers": numbers})


@router.get("/sessions/{sid}/print")
def print_view(
    request: Request, db: Db, blobs: Blobs, sid: Id, who: Annotated[Identity, require(Action.READ_RESULT)]
) -> Response:
    """Two sheets of A4 for the browser's own print."""
    return _session_page(request, db, blobs, sid, who, "print.html", paper=True)


@router.get("/sessions/{sid}/data")
def data(
    request: Request, db: Db, blobs: Blobs, sid: Id, who: Annotated[Identity, require(Action.READ_SESSION)]
) -> Response:
    """Downloads, the estimator's health, provenance, running again."""
    with db.read() as c:
        context = session_views.base(c, sid)
        context |= session_views.downloads(c, blobs, sid, results=who.may(Action.READ_RESULT))
    _opened(request, who, "session", sid)
    return _page(request, db, who, "data.html", "patients", **context)


@router.get("/jobs")
def jobs(request: Request, db: Db, who: Annotated[Identity, require(Action.READ_JOB)]) -> Response:
    """What is being computed, and what was."""
    with db.read() as c:
        rows = page_views.job_rows(c)
    _listed(request, who, "job")
    return _page(request, db, who, "jobs.html", "jobs", jobs=rows)


@router.get("/users")
def users(request: Request, db: Db, who: Annotated[Identity, require(Action.MANAGE_USERS)]) -> Response:
    """Who may sign in, and as what."""
    with db.read() as c:
        rows = accounts.everyone(c)
    roles = [(role.value, page_views.ROLE_WORDS[role]) for role in Role]
    options = [(role.value, role.value) for role in Role]
    return _page(
        request, db, who, "users.html", "users",
        users=rows, roles=roles, role_options=options, min_password=MIN_LENGTH,
    )  # fmt: skip


@router.get("/audit")
def audit_log(
    request: Request,
    db: Db,
    who: Annotated[Identity, require(Action.READ_AUDIT)],
    before: Annotated[int | None, Query(ge=1, le=2**53)] = None,
) -> Response:
    """Who opened or changed what, the newest first."""
    with db.read() as c:
        rows = audit.entries(c, before=before, limit=AUDIT_ROWS)
    older = rows[-1].seq if len(rows) == AUDIT_ROWS else None
    return _page(request, db, who, "audit.html", "audit", rows=rows, older=older)


@router.get("/account")
def account(request: Request, db: Db, who: Annotated[Identity, require(Action.USE_ACCOUNT)]) -> Response:
    """One's own password, and signing out."""
    return _page(
        request, db, who, "account.html", "account",
        user=who, role_text=page_views.ROLE_WORDS[who.role], min_password=MIN_LENGTH,
    )  # fmt: skip


def _session_page(
    request: Request,
    db: Database,
    blobs: BlobStore,
    sid: str,
    who: Identity,
    template: str,
    *,
    paper: bool = False,
) -> Response:
    with db.read() as c:
        context = session_views.base(c, sid)
        patient = context["patient"]
        done = histories.analysed(c, patient.id) if who.may(Action.READ_RESULT) else []
        this = next((a for a in done if a.session.id == sid), None)
        if this is not None:
            context["before"] = comparisons.before(c, this.session, done)
            trained = feedback.gather(c, patient, sid, done)
    if this is None and paper:
        return RedirectResponse(f"/sessions/{sid}", status_code=303)
    if this is not None:
        context["report"] = session_views.report(blobs, this.found, this.edits, context, paper=paper)
        context["feedback"] = feedback.view(blobs, trained)
    _opened(request, who, "session", sid)
    return _page(request, db, who, template, "patients", **context)
