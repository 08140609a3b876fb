"""Training programme of a patient: planned visits and their sessions."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import Annotated, Any, Final

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.core.message import Message, join_messages
from sagittal.core.plurals import plural
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, programmes, sessions
from sagittal.server.clinic.course import SIX_WEEKS
from sagittal.server.clinic.programmes import PlannedVisit, Programme
from sagittal.server.context import Db, Id
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.report.words.wording import format_number
from sagittal.server.storage.schema.tables import now
from sagittal.web.words import day

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

STATE_WORDS: Final[Mapping[str, tuple[str, str]]] = {
    "done": ("ok", "Done"),
    "missing": ("warn", "Missing"),
    "next": ("run", "Next"),
    "planned": ("none", "Planned"),
}
"""State of a planned visit → symbol and word."""


@router.get("/patients/{pid}/programme")
def show_programme(
    request: Request, db: Db, pid: Id, user: Annotated[Identity, require(Action.READ_SESSION)]
) -> Response:
    """Latest programme of a patient: planned visits and their sessions."""
    today = now().date()
    with db.read() as c:
        patient = patients.get(c, pid)
        plans = programmes.of_patient(c, pid)
        linked = {v.session_id for plan in plans for v in plan.visits}
        free = [s for s in sessions.of_patient(c, pid) if s.id not in linked]
    record_opening(request, user, "patient", pid)
    return render_page(
        request, db, user, "programme.html", "patients",
        patient=patient,
        programme=view_programme(plans[0], today) if plans else None,
        course=SIX_WEEKS,
        free=free,
        monday=today + dt.timedelta(days=-today.weekday() % 7),
    )  # fmt: skip


def view_programme(programme: Programme, today: dt.date) -> dict[str, Any]:
    """Template context of a programme: timeline of weeks and list."""
    now_week = (today - programme.starts_on).days // 7 + 1
    weeks = range(min(v.week for v in programme.visits), max(v.week for v in programme.visits) + 1)
    upcoming = programme.next
    visits = len(programme.visits)
    parts = [
        Message(
            f"{{count}} of {{visits}} {plural(visits, 'visit', 'visits')} completed",
            count=programme.count("done"),
            visits=visits,
        )
    ]
    if missing := programme.count("missing"):
        parts.append(Message("{missing} missing", missing=missing))
    if upcoming is not None:
        parts.append(
            Message("next {label} on {planned_on}", label=upcoming.label, planned_on=day(upcoming.planned_on))
        )
    return {
        "id": programme.id,
        "starts_on": programme.starts_on,
        "words": programme.words,
        "summary": ", ".join(parts),
        "weeks": [_week(programme, week, now=week == now_week) for week in weeks],
        "visits": [_planned(v) for v in programme.visits],
    }


def _week(programme: Programme, week: int, *, now: bool) -> dict[str, Any]:
    mine = [v for v in programme.visits if v.week == week]
    trainings = [v for v in mine if v.kind == "training"]
    done = sum(v.state == "done" for v in trainings)
    missing = sum(v.state == "missing" for v in trainings)
    text: str = Message(
        f"{{done}} of {{trainings}} {plural(len(trainings), 'training', 'trainings')} completed",
        done=done,
        trainings=len(trainings),
    )
    if missing:
        text = join_messages(text, Message(", {missing} missing", missing=missing), between="")
    # the course counts weeks without a week 0: the one before the first training is −1
    return {
        "name": "now"
        if now
        else Message("wk {format_number}", format_number=format_number(week if week > 0 else week - 1)),
        "now": now,
        "gap": not mine,
        "assessments": [v for v in mine if v.kind == "assessment"],
        "trainings": trainings,
        "words": text,
    }


def _planned(v: PlannedVisit) -> dict[str, Any]:
    shape, word = STATE_WORDS[v.state]
    return {**vars(v), "shape": shape, "word": word}
