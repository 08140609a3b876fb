"""What the pages around a session show, as plain values for the templates."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from sqlalchemy import Connection, func, select

from core.errors import FormatError
from server.auth.roles import Role
from server.jobs.queue import JobView
from server.report.exports import parameter_row
from server.report.wording import TERMS
from server.services import analyses, jobs, live, reviews, sessions
from server.services.patients import Patient
from server.storage.blobs import BlobStore, IntegrityError
from server.storage.tables import ACTIVE_STATES, job, patient
from web.words import number, seconds

JOBS_SHOWN: Final = 100
FOLLOWED: Final = 3

PROTOCOLS: Final = (
    ("walk", "Walk", "Over ground, there and back, with a few seconds of quiet standing before or after."),
    ("treadmill", "Treadmill", "Walking on the belt, with a few seconds of quiet standing before or after."),
)
PROTOCOL_NAMES: Final = {value: name for value, name, _ in PROTOCOLS}

ROLE_WORDS: Final[Mapping[Role, str]] = {
    Role.ADMIN: "Everything, users and the audit log included.",
    Role.CLINICIAN: "Patients, uploads, analyses and results.",
    Role.ASSISTANT: "Adds sessions and uploads recordings; sees what was found in them, not the results.",
    Role.VIEWER: "Reads patients and results, changes nothing.",
}

SEGMENT_NAMES: Final = {
    "pelvis": "Pelvis",
    "thigh_l": "Left thigh",
    "thigh_r": "Right thigh",
    "shank_l": "Left shank",
    "shank_r": "Right shank",
    "foot_l": "Left foot",
    "foot_r": "Right foot",
    "chest": "Chest",
}

KEY_PARAMETERS: Final = tuple(
    {"name": name, "label": TERMS[name].label, "unit": TERMS[name].unit, "digits": TERMS[name].digits}
    for name in ("cadence_spm", "stride_time_s", "stance_pct", "knee_flexion_rom_deg")
)
"""Columns of the results by visit."""

STATES: Final[Mapping[str, tuple[str, str]]] = {
    "empty": ("none", "No recording yet"),
    "uploaded": ("warn", "Check sensors"),
    "running": ("run", "Analysing"),
    "done": ("ok", "Analysed"),
    "failed": ("bad", "Not analysable"),
}
"""State of a session → shape and word."""

JOB_WORDS: Final[Mapping[str, tuple[str, str]]] = {
    "queued": ("none", "Waiting"),
    "running": ("run", "Running"),
    "done": ("ok", "Done"),
    "failed": ("bad", "Failed"),
    "cancelled": ("none", "Cancelled"),
}
KIND_WORDS: Final = {"inspect": "Reading the files", "analyse": "Analysis"}


def who_words(sex: str | None, birth_year: int | None) -> str:
    """Sex and age as in "M, 58 y"."""
    parts = [sex[0].upper()] if sex else []
    if birth_year:
        parts.append(f"{dt.datetime.now(dt.UTC).year - birth_year} y")
    return ", ".join(parts)


def status(state: str) -> dict[str, str]:
    """Shape and word of a session's state."""
    kind, text = STATES[state]
    return {"kind": kind, "text": text}


def patient_view(p: Patient) -> dict[str, Any]:
    """A patient with sex and age in words."""
    return {**vars(p), "who": who_words(p.sex, p.birth_year)}


def patient_rows(
    c: Connection, blobs: BlobStore, found: Sequence[Patient], *, results: bool
) -> list[dict[str, Any]]:
    """Rows of the patients list, each with the state of its latest visit; with `results`, of its data."""
    rows = []
    streaming = {take.patient_id: take.session_id for take in live.streaming(c)}
    newest = sessions.newest_of(c, [p.id for p in found])
    running = _active(c, lambda j: j.patient_id)
    shown = analyses.latest_of(c, [s.id for s in newest.values()]) if results else {}
    edits = reviews.edits_of_all(c, [a.id for a in shown.values()])
    for p in found:
        if p.id in newest:
            last = _state_of(blobs, newest[p.id], shown.get(newest[p.id].id), edits)
        else:
            last = {"kind": "none", "text": "No session yet"}
        row = {"visits": p.sessions, "last": p.last_visit, "job": running.get(p.id), "status": last}
        rows.append(patient_view(p) | row | {"live": streaming.get(p.id)})
    follow_few([row["job"] for row in rows])
    return rows


def patient_count(c: Connection) -> int:
    """How many patients there are."""
    return c.execute(select(func.count()).select_from(patient)).scalar_one()


def running_jobs(c: Connection) -> int:
    """How many jobs wait or run."""
    return c.execute(select(func.count()).select_from(job).where(job.c.state.in_(ACTIVE_STATES))).scalar_one()


def visits(c: Connection, blobs: BlobStore, patient_id: str, *, results: bool) -> list[dict[str, Any]]:
    """The visits of a patient, newest first, with the key parameters of each visit's latest analysis."""
    rows = []
    streaming = {take.session_id for take in live.streaming(c)}
    running = _active(c, lambda j: j.session_id)
    there = sessions.of_patient(c, patient_id)
    shown = analyses.latest_of(c, [s.id for s in there]) if results else {}
    edits = reviews.edits_of_all(c, [found.id for found in shown.values()])
    for s in there:
        latest = shown.get(s.id)
        numbers = reviews.numbers(blobs, latest, edits[latest.id]).parameters if latest else ()
        cells, strides = key_cells([parameter_row(p) for p in numbers])
        rows.append(
            {
                **vars(s),
                "href": f"/sessions/{s.id}{_page_of(s, live=s.id in streaming)}",
                "live": s.id in streaming,
                "condition": s.walked().words,
                "cells": cells,
                "strides": strides,
                "job": running.get(s.id),
                "status": _state_of(blobs, s, latest, edits),
            }
        )
    follow_few([row["job"] for row in rows])
    return rows


def _state_of(
    blobs: BlobStore,
    s: sessions.Session,
    shown: analyses.Analysis | None,
    edits: Mapping[str, reviews.Edits],
) -> dict[str, str]:
    """What a list says of a session: of one that is analysed how good its data are, as its own page does."""
    if s.state != "done" or shown is None or "analysis.json" not in shown.files:
        return status(s.state)
    try:
        kind, text = reviews.verdict(blobs, shown, edits[shown.id])
    except (IntegrityError, FormatError):  # its own page says what is wrong; the others stay in reach
        kind, text = "bad", "Cannot be read"
    return {"kind": kind, "text": text}


def _page_of(s: sessions.Session, *, live: bool) -> str:
    """The page of a session on which there is something to do."""
    if live:
        return "/live"
    return "/upload" if s.state in {"empty", "uploaded"} else ""


def key_cells(parameters: Sequence[Mapping[str, Any]]) -> tuple[list[dict[str, Any]], dict[str, int] | None]:
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


def job_rows(c: Connection) -> list[dict[str, Any]]:
    """The newest jobs, each with its visit."""
    rows = []
    for listed in jobs.listing(c, limit=JOBS_SHOWN):
        view = listed.job
        shape, word = JOB_WORDS[view.state]
        ended = view.started_at and view.finished_at
        visit = {"id": listed.session_id, "code": listed.patient_code, "title": listed.session_title}
        rows.append(
            job_dict(view)
            | {
                "shape": shape,
                "word": word,
                "what": KIND_WORDS.get(view.kind, view.kind),
                "took": seconds((view.finished_at - view.started_at).total_seconds()) if ended else None,  # type: ignore[operator]
                "session": visit if listed.session_id else None,
            }
        )
    follow_few(rows)
    return rows


def job_dict(view: JobView) -> dict[str, Any]:
    """A job for the templates: `active` = will still change; `live` = the page follows it."""
    return {**vars(view), "active": not view.finished, "live": not view.finished}


def follow_few(found: Sequence[dict[str, Any] | None]) -> None:
    """Follow the first jobs of a list only: each takes one of the six connections a browser has."""
    active = [j for j in found if j is not None and j["active"]]
    active.sort(key=lambda j: j["state"] != "running")
    for j in active[FOLLOWED:]:
        j["live"] = False


def newest_job(c: Connection, session_id: str) -> JobView | None:
    """The job a session's pages speak of."""
    return next(iter(jobs.of_session(c, session_id)), None)


def _active(c: Connection, whose: Callable[[jobs.ListedJob], str | None]) -> dict[str | None, dict[str, Any]]:
    """The running job, else the newest that waits, by what `whose` takes of it (patient or session)."""
    found: dict[str | None, dict[str, Any]] = {}
    for listed in jobs.active(c):
        found.setdefault(whose(listed), job_dict(listed.job))
    return found
