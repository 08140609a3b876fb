"""Patient list."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.responses import Response

from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.user_text import UserText
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import patients, programmes, sessions
from sagittal.server.clinic.patients import Patient
from sagittal.server.context import Db, Reviewed
from sagittal.server.live_takes import live
from sagittal.server.pages.clinic.visit_state import describe_live, judge_visit
from sagittal.server.pages.job_views import find_active_jobs, follow_few
from sagittal.server.pages.shell import record_listing, render_page
from sagittal.server.pages.words import describe_person
from sagittal.server.report.words.change_words import change_words
from sagittal.server.results import analyses, edit_log, visits
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.sharing import care_teams
from sagittal.server.storage.schema.tables import now
from sagittal.web.words import number

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

PATIENTS_SHOWN = 200
HOUR: Final = dt.timedelta(hours=1)

FILTERS: Final = (
    ("", "All"),
    ("programme", "In a programme"),
    ("today", "Here today"),
    ("check", "To check"),
)
"""Filters of the list: key and label."""


@router.get("/patients")
def show_patients(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    user: Annotated[Identity, require(Action.READ_PATIENT)],
    q: Annotated[str, Query(max_length=200)] = "",
) -> Response:
    """All patients, latest visit first."""
    with db.read() as c:
        listed = patients.list_counted(c, user, search=q, limit=PATIENTS_SHOWN)
        rows = list_patients(c, reviewed, listed.patients, results=user.may(Action.READ_RESULT))
    record_listing(request, user, "patient")
    return render_page(
        request, db, user, "patients.html", "patients", listed.active_jobs,
        patients=rows, query=UserText(q), total=listed.total,
        filters=[(key, words, sum(not key or key in r["kinds"] for r in rows)) for key, words in FILTERS],
        results=user.may(Action.READ_RESULT), in_teams=listed.teams_on and not user.is_admin,
        hours=care_teams.EMERGENCY // HOUR,
    )  # fmt: skip


def view_patient(p: Patient) -> dict[str, Any]:
    """A patient with sex and age in words."""
    return {**vars(p), "who": describe_person(p.sex, p.birth_year)}


def list_patients(
    c: Connection, reviewed: ReviewedAnalyses, listed: Sequence[Patient], *, results: bool
) -> list[dict[str, Any]]:
    """Rows of the patient list with the state of the latest visit and, with `results`, its data quality."""
    rows = []
    takes = {take.patient_id: describe_live(take) for take in live.list_running(c)}
    newest = sessions.newest_of(c, [p.id for p in listed])
    running = find_active_jobs(c, [p.id for p in listed], lambda j: j.patient_id)
    today = now().date()
    plans = programmes.read_plans(c, [p.id for p in listed], today)
    walks = visits.choose_newest_walks(c, [p.id for p in listed], plans.kinds) if results else {}
    session_ids = {s.id for s in newest.values()} | {w.id for chosen in walks.values() for w in chosen}
    records = analyses.latest_of(c, session_ids) if results else {}
    edits = edit_log.edits_of_all(c, [a.id for a in records.values()])
    speeds = visits.read_newest_speeds(reviewed, walks, records, edits)
    for p in listed:
        if p.id in newest:
            last = judge_visit(reviewed, newest[p.id], records.get(newest[p.id].id), edits)
        else:
            last = {"kind": "none", "text": "No visit yet"}
        row: dict[str, Any] = {
            "visits": p.sessions,
            "last": p.last_visit,
            "job": running.get(p.id),
            "status": last,
        }
        speed = speeds.get(p.id)
        row["speed"] = None if speed is None else number(speed.mean.mean, CATALOGUE[visits.SPEED].digits)
        row["change"] = None if speed is None or speed.change is None else change_words(speed.change)
        kinds = {
            "programme": p.id in plans.running,
            "today": p.last_visit == today,
            "check": last["kind"] in {"warn", "bad"},
        }
        row["kinds"] = [kind for kind, holds in kinds.items() if holds]
        rows.append(view_patient(p) | row | {"live": takes.get(p.id)})
    follow_few([row["job"] for row in rows])
    return rows
