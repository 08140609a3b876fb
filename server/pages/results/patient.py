"""Patient page: identity, programme, five key parameters, visits with their trials, notes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Annotated, Any, Final

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.responses import Response

from sagittal.core.change import parameter_changes
from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.result import Parameter
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import consents, notes, patients, sessions
from sagittal.server.clinic.programmes import PlannedVisit
from sagittal.server.context import Config, Db, Id, Reviewed
from sagittal.server.live_takes import live
from sagittal.server.pages.clinic.identity import offers_identity
from sagittal.server.pages.clinic.patients import view_patient
from sagittal.server.pages.clinic.programme import view_programme
from sagittal.server.pages.clinic.visit_state import describe_live, judge_visit
from sagittal.server.pages.job_views import find_active_jobs, follow_few
from sagittal.server.pages.results.prescription import make_card
from sagittal.server.pages.results.trends import draw_figures
from sagittal.server.pages.shell import record_opening, render_page
from sagittal.server.report.history.takes_chart import find_scale, takes_svg
from sagittal.server.report.history.trends import VisitKind
from sagittal.server.report.words.change_words import change_words
from sagittal.server.results import edit_log, histories, prescriptions, visits
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.results.reviewed import UNREADABLE, ReviewedAnalyses
from sagittal.server.results.visits import SPEED, ClinicVisit, TakesFigure
from sagittal.server.sharing import care_teams
from sagittal.server.storage.files.blobs import StoreAway
from sagittal.server.storage.schema.tables import now
from sagittal.web.words import number

PURPOSE_WORDS: Final = {
    "recording": "Measuring and storing",
    "research": "Use in research",
    "teaching": "Use in teaching",
    "sharing": "Passing on to another clinic",
}
"""Purpose of a consent → words."""

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/patients/{pid}")
def show_patient(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    settings: Config,
    pid: Id,
    user: Annotated[Identity, require(Action.READ_PATIENT)],
) -> Response:
    """Patient page: identity, programme, five key parameters, visits with their trials, notes."""
    results = user.may(Action.READ_RESULT)
    with db.read() as c:
        patient = patients.get(c, pid)
        done, plans = histories.read(c, patient)
        planned = {v.session_id: v for plan in plans for v in plan.visits if v.session_id is not None}
        rows = list_visits(c, reviewed, pid, done if results else [], planned)
        written_down = notes.of_patient(c, pid)
        agreed = consents.of_patient(c, pid)
        written = prescriptions.of_patient(c, pid) if results else []
        team = view_team(c, user, pid)
    record_opening(request, user, "patient", pid)
    trend = None
    if results:
        trained = next((w.content for w in written if w.ended_at is None), None)
        with suppress(StoreAway):  # the visits report that they are unreadable; a new one can be started
            history = histories.read_history(reviewed, patient, done, plans)
            trend = draw_figures(history, None if trained is None else trained.parameter)
    walked = histories.baseline([a for a in done if a.session.protocol in sessions.WALKS])
    return render_page(
        request, db, user, "patient.html", "patients",
        patient=view_patient(patient), visits=rows, today=now().date(),
        facts=list_facts(patient, None if walked is None else walked.condition.words),
        notes=list_notes(written_down, rows, user),
        consents=[(one, PURPOSE_WORDS[one.purpose]) for one in agreed], purposes=list(PURPOSE_WORDS.items()),
        programme=view_programme(plans[0], now().date()) if plans else None,
        team=team, trend=trend, comparable=len(done) > 1 and results, feedback=make_card(written),
        identity_kept=offers_identity(settings),
    )  # fmt: skip


def view_team(c: Connection, user: Identity, patient_id: str) -> dict[str, Any] | None:
    """Care team and emergency access; None if the clinic has no care teams."""
    if not care_teams.are_on(c):
        return None
    people = care_teams.list_people(c, patient_id)
    return {
        "members": [one for one, is_in in people if is_in],
        "choices": people,
        "emergencies": [
            (one, one.is_open and care_teams.may_end(one, user))
            for one in care_teams.list_accesses(c, patient_id)
        ],
    }


def list_facts(patient: patients.Patient, walks: str | None) -> list[tuple[str, str]]:
    """One-line summary of the patient and usual walking condition."""
    facts = [
        ("Note", patient.note),
        ("Affected side", patient.affected_side or ""),
        ("Condition", walks or ""),
        ("Height", "" if patient.height_m is None else f"{patient.height_m:.2f}\u202fm"),
        ("Serves as", "reference of this clinic" if patient.is_control else ""),
    ]
    return [(label, text) for label, text in facts if text]


def list_notes(
    written: Sequence[notes.PatientNote], rows: Sequence[Mapping[str, Any]], user: Identity
) -> list[dict[str, Any]]:
    """Notes about the patient and notes of visits, latest date first."""
    writes, may_edit_all = user.may(Action.WRITE_PATIENT), user.may(Action.MANAGE_USERS)
    entries: list[dict[str, Any]] = [
        {
            "id": n.id,
            "day": n.written_on,
            "by": n.by,
            "text": n.content,
            "removable": writes and notes.may_remove(n, user, of_others=may_edit_all),
        }
        for n in written
    ]
    entries += [
        {"id": None, "day": row["day"], "visit": take["title"], "href": take["href"], "text": take["note"]}
        for row in rows
        for take in row["takes"]
        if take["note"]
    ]
    return sorted(entries, key=lambda n: n["day"], reverse=True)


def list_visits(
    c: Connection,
    reviewed: ReviewedAnalyses,
    patient_id: str,
    done: Sequence[AnalysedSession],
    planned: Mapping[str, PlannedVisit],
) -> list[dict[str, Any]]:
    """Visits of a patient, newest first, with their trials; unanalysed sessions are separate visits.

    Parameters
    ----------
    done : analysed sessions, oldest first; empty for users without access to results.
    planned : session → its planned visit.
    """
    takes_now = {take.session_id: describe_live(take) for take in live.list_running(c)}
    running = find_active_jobs(c, [patient_id], lambda j: j.session_id)
    by_session = {a.session.id: a for a in done}
    kinds = {key: v.kind for key, v in planned.items()}
    edits = edit_log.edits_of_all(c, [a.found.id for a in done])
    grouped = visits.group_takes(done)
    measured = {id(v): _measure(reviewed, v) for v in grouped}
    scale = find_scale([p for speeds in measured.values() if speeds for p in speeds.takes])
    rows: list[dict[str, Any]] = []
    listed: set[str] = set()
    for s in sessions.of_patient(c, patient_id):
        if s.id in listed:
            continue
        visit = next((v for v in grouped if s.id in {t.session.id for t in v.takes}), None)
        mine = [s] if visit is None else [t.session for t in reversed(visit.takes)]
        listed.update(m.id for m in mine)
        takes = [
            {
                **vars(m),
                "href": f"/sessions/{m.id}{_find_page(m, live=m.id in takes_now)}",
                "live": takes_now.get(m.id),
                "analysed": m.id in by_session,
                "job": running.get(m.id),
                "status": judge_visit(
                    reviewed, m, by_session[m.id].found if m.id in by_session else None, edits
                ),
                "speed": None,
            }
            for m in mine
        ]
        row: dict[str, Any] = {
            "day": s.performed_on,
            "condition": s.walked().words,
            "takes": takes,
            "figure": None,
            "label": next((planned[m.id].label for m in mine if m.id in planned), None),
        }
        if visit is not None:
            row["condition"] = visit.condition.words
            row |= _view_speed(visit, grouped, measured, kinds, scale)
            for take, speed in zip(takes, reversed(row["speeds"]), strict=True):
                take["speed"] = speed
        rows.append(row)
    follow_few([take["job"] for row in rows for take in row["takes"]])
    return rows


def _measure(reviewed: ReviewedAnalyses, visit: ClinicVisit) -> TakesFigure | None:
    """Gait speed of every trial and their mean; None if unreadable or not measured."""
    try:
        return visits.measure_visit(reviewed, visit).get((SPEED, None))
    except UNREADABLE:
        return None


def _view_speed(
    visit: ClinicVisit,
    grouped: Sequence[ClinicVisit],
    measured: Mapping[int, TakesFigure | None],
    planned: Mapping[str, VisitKind],
    scale: tuple[float, float] | None,
) -> dict[str, Any]:
    """Gait speed of a visit and its trials, and the change since the visit used for comparison."""
    own = measured[id(visit)]
    by_take = {} if own is None else own.by_take
    view: dict[str, Any] = {
        "speeds": [_print(by_take.get(t.session.id)) for t in visit.takes],
        "speed": None if own is None else _print(own.mean),
        "change": None,
        "compared": "not compared" if visit.condition.feedback else "first in this condition",
    }
    if own is not None and scale is not None and own.mean.mean is not None:
        text_speeds = ", ".join(text for text in view["speeds"] if text)
        view["figure"] = takes_svg(
            own.takes,
            own.mean,
            scale,
            Message("Trials {text_speeds}, mean {speed} m/s", text_speeds=text_speeds, speed=view["speed"]),
        )
    previous = visits.find_before(grouped, visit, planned)
    if previous is not None:
        earlier = measured[id(previous)]
        view["compared"] = "speed not measured in both"
        if own is not None and earlier is not None:
            change = parameter_changes([earlier.mean], [own.mean])[0]
            view |= {"change": change_words(change), "compared": None, "since": previous.day}
    return view


def _print(p: Parameter | None) -> str | None:
    return None if p is None or p.mean is None else number(p.mean, CATALOGUE[SPEED].digits)


def _find_page(s: sessions.Session, *, live: bool) -> str:
    """The page of a session that requires action."""
    if live:
        return "/live"
    return "/upload" if s.state in {"empty", "uploaded"} else ""
