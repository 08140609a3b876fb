"""One patient: programme, the trend of one figure, results by visit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Final

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from sqlalchemy import Connection
from starlette.responses import Response

from core.parameters.catalogue import CATALOGUE
from server.auth.access import require
from server.auth.identity import Identity
from server.auth.roles import Action
from server.context import Db, Id, Reviewed
from server.pages.job_views import find_active_jobs, follow_few
from server.pages.patients import view_patient
from server.pages.prescription import make_card
from server.pages.programme import view_programme
from server.pages.shell import record_opening, render_page
from server.pages.trends import draw_teaser
from server.pages.visit_state import judge_visit
from server.report.exports import parameter_row
from server.services import analyses, edit_log, histories, live, patients, prescriptions, sessions
from server.services.reviewed import ReviewedAnalyses
from server.storage.tables import now
from web.words import number

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

KEY_PARAMETERS: Final = tuple(
    {"name": e.name, "label": e.label, "unit": e.printed_unit, "digits": e.digits}
    for name in ("cadence_spm", "stride_time_s", "stance_pct", "knee_flexion_rom_deg")
    for e in (CATALOGUE[name],)
)
"""Columns of the results by visit."""


@router.get("/patients/{pid}")
def show_patient(
    request: Request,
    db: Db,
    reviewed: Reviewed,
    pid: Id,
    who: Annotated[Identity, require(Action.READ_PATIENT)],
) -> Response:
    """One patient: programme, the trend of one figure, results by visit."""
    with db.read() as c:
        patient = patients.get(c, pid)
        visits = list_visits(c, reviewed, pid, results=who.may(Action.READ_RESULT))
        done, plans = histories.read(c, patient)
        written = prescriptions.of_patient(c, pid) if who.may(Action.READ_RESULT) else []
    record_opening(request, who, "patient", pid)
    trend = None
    if who.may(Action.READ_RESULT):
        trend = draw_teaser(histories.read_history(reviewed, patient, done, plans))
    return render_page(
        request, db, who, "patient.html", "patients",
        patient=view_patient(patient), visits=visits, keys=KEY_PARAMETERS,
        programme=view_programme(plans[0], now().date()) if plans else None,
        planned={v.session_id: v.label for plan in plans for v in plan.visits if v.session_id},
        trend=trend, comparable=len(done) > 1, feedback=make_card(written),
    )  # fmt: skip


def list_visits(
    c: Connection, reviewed: ReviewedAnalyses, patient_id: str, *, results: bool
) -> list[dict[str, Any]]:
    """The visits of a patient, newest first, with the key parameters of each visit's latest analysis."""
    rows = []
    streaming = {take.session_id for take in live.list_streaming(c)}
    running = find_active_jobs(c, lambda j: j.session_id)
    there = sessions.of_patient(c, patient_id)
    shown = analyses.latest_of(c, [s.id for s in there]) if results else {}
    edits = edit_log.edits_of_all(c, [found.id for found in shown.values()])
    for s in there:
        latest = shown.get(s.id)
        numbers = reviewed.read_numbers(latest, edits[latest.id]).parameters if latest else ()
        cells, strides = list_key_cells([parameter_row(p) for p in numbers])
        rows.append(
            {
                **vars(s),
                "href": f"/sessions/{s.id}{_find_page(s, live=s.id in streaming)}",
                "live": s.id in streaming,
                "condition": s.walked().words,
                "cells": cells,
                "strides": strides,
                "job": running.get(s.id),
                "status": judge_visit(reviewed, s, latest, edits),
            }
        )
    follow_few([row["job"] for row in rows])
    return rows


def _find_page(s: sessions.Session, *, live: bool) -> str:
    """The page of a session on which there is something to do."""
    if live:
        return "/live"
    return "/upload" if s.state in {"empty", "uploaded"} else ""


def list_key_cells(
    parameters: Sequence[Mapping[str, Any]],
) -> tuple[list[dict[str, Any]], dict[str, int] | None]:
    """Cells of KEY_PARAMETERS and the strides of each side behind them."""
    by = {(p["name"], p["side"]): p for p in parameters}
    cells: list[dict[str, Any]] = []
    for key in KEY_PARAMETERS:
        left, right, both = (by.get((key["name"], side)) for side in ("left", "right", None))
        text = [number(p["mean"] if p else None, int(str(key["digits"]))) for p in (left, right, both)]
        has_sides = any(p and p["mean"] is not None for p in (left, right))
        one = text[2] if both and both["mean"] is not None else None
        cells.append({"both": has_sides, "left": text[0], "right": text[1], "one": one})
    times = [by.get(("stride_time_s", side)) for side in ("left", "right")]
    found = {side: p["n"] for side, p in zip(("left", "right"), times, strict=True) if p}
    return cells, {"left": found.get("left", 0), "right": found.get("right", 0)} if found else None
