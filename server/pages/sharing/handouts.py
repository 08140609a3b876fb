"""Handouts in addition to the report: the patient's leaflet, and the report over all visits."""

from __future__ import annotations

from typing import Annotated, Any, Final

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.core.change import Change
from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, sessions
from sagittal.server.context import Config, Db, Id, OpenTrail, Reviewed
from sagittal.server.errors import Conflict
from sagittal.server.pages.results.trends import view_trends
from sagittal.server.pages.sharing.paper import print_pdf
from sagittal.server.pages.shell import render_sheets
from sagittal.server.pages.words import describe_person
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.report.history.comparison import compare_figures
from sagittal.server.report.history.leaflet import list_figures
from sagittal.server.report.history.numbers import Numbers
from sagittal.server.report.words.feedback_words import side_words
from sagittal.server.results import comparisons, histories, prescriptions
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import now
from sagittal.web.words import day

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
Reader = Annotated[Identity, require(Action.READ_RESULT)]
LEAFLET, COURSE = "leaflet.html", "course.html"
CHART_HEIGHT: Final = 108
"""In px, for five rows of charts per page."""


@router.get("/sessions/{sid}/leaflet")
def show_leaflet(
    request: Request, db: Db, reviewed: Reviewed, trail: OpenTrail, sid: Id, user: Reader
) -> Response:
    """Leaflet for the patient in plain language and large print."""
    context = gather_leaflet(db, reviewed, sid)
    trail.record_opened(user, "leaflet.opened", "session", sid)
    return render_sheets(request, user, LEAFLET, **context)


@router.get("/sessions/{sid}/leaflet.pdf")
def make_leaflet(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    trail: OpenTrail,
    settings: Config,
    sid: Id,
    user: Reader,
) -> Response:
    """The leaflet as PDF."""
    context = gather_leaflet(db, reviewed, sid)
    trail.record_opened(user, "leaflet.opened", "session", sid)
    return print_pdf(request, settings, LEAFLET, context, f"leaflet-{sid[:8]}.pdf")


@router.get("/patients/{pid}/course")
def show_course(
    request: Request, db: Db, reviewed: Reviewed, trail: OpenTrail, pid: Id, user: Reader
) -> Response:
    """Report over all visits: main parameters with measurement errors, conditions, dates."""
    context = gather_course(db, reviewed, pid)
    trail.record_opened(user, "course.opened", "patient", pid)
    return render_sheets(request, user, COURSE, **context)


@router.get("/patients/{pid}/course.pdf")
def make_course(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    trail: OpenTrail,
    settings: Config,
    pid: Id,
    user: Reader,
) -> Response:
    """The report over all visits as PDF."""
    context = gather_course(db, reviewed, pid)
    trail.record_opened(user, "course.opened", "patient", pid)
    return print_pdf(request, settings, COURSE, context, f"course-{pid[:8]}.pdf")


def gather_leaflet(db: Database, reviewed: ReviewedAnalyses, sid: str) -> dict[str, Any]:
    """Template context of the leaflet of a walk; raises Conflict if no walk is analysed."""
    with db.read() as c:
        patient = patients.get(c, sessions.get(c, sid).patient_id)
        done = histories.list_analysed(c, patient.id)
        this = next((a for a in done if a.session.id == sid), None)
        if this is None or this.session.protocol not in sessions.WALKS:
            raise Conflict("no_walk", "This visit has no analysed walk, so there is no leaflet.")
        previous = comparisons.find_previous(c, this.session, done)
        written = prescriptions.of_patient(c, patient.id)
    new = reviewed.read_numbers(this.found, this.edits)
    old = None if previous is None else reviewed.read_numbers(previous.found, previous.edits)
    if old is not None and not _is_usable(old):
        old = previous = None
    if previous is None or old is None:
        changes: tuple[Change, ...] = ()
    else:
        norms = comparisons.pair_norms(patient, (previous.session, old), (this.session, new))
        changes = compare_figures(old, new, norms, patient.affected_side)
    trained = next((w.content for w in written if w.ended_at is None), None)
    return {
        "patient": patient,
        "session": this.session,
        "back": f"/sessions/{sid}/report",
        "pdf": f"/sessions/{sid}/leaflet.pdf",
        "figures": list_figures(new.parameters, changes, patient.affected_side) if _is_usable(new) else (),
        "before": None if previous is None else previous.session.performed_on,
        "practise": None if trained is None else CATALOGUE[trained.parameter].everyday,
        "practise_side": None if trained is None else side_words(trained.side),
        "made_by": Message(
            "Sagittal {code_version} · {created_at}",
            code_version=this.found.code_version,
            created_at=day(this.found.created_at),
        ),
    }


def _is_usable(numbers: Numbers) -> bool:
    """Whether values may be reported and compared: not with poor data quality."""
    return numbers.verdict[0] != "bad"


def gather_course(db: Database, reviewed: ReviewedAnalyses, pid: str) -> dict[str, Any]:
    """Template context of the report over the visits; raises Conflict if nothing is analysed."""
    with db.read() as c:
        patient = patients.get(c, pid)
        done, plans = histories.read(c, patient)
    walks = [a for a in done if a.session.protocol != "activity"]
    if not walks:
        raise Conflict(
            "no_visit", "No visit of this patient has been analysed, so there is no report over visits."
        )
    history = histories.read_history(reviewed, patient, walks, plans)
    titles = {a.session.id: a.session.title for a in walks}
    conditions = {a.session.id: a.condition.words for a in walks}
    identity = [
        ("Code", patient.code),
        ("Age, sex", describe_person(patient.sex, patient.birth_year) or "not given"),
        ("Affected side", patient.affected_side or "none or both"),
        ("Visits", str(len(history.visits))),
    ]
    return {
        "patient": patient,
        "back": f"/patients/{pid}/trends",
        "pdf": f"/patients/{pid}/course.pdf",
        "trends": view_trends(history, [], CHART_HEIGHT),
        "identity": identity,
        "titles": [titles[v.session_id] for v in history.visits],
        "conditions": [conditions[v.session_id] for v in history.visits],
        "made_by": Message("Sagittal {CODE_VERSION} · {day}", CODE_VERSION=CODE_VERSION, day=day(now())),
    }
