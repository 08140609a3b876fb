"""What the pages around a session show, as plain values for the templates."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from typing import Any, Final

from sqlalchemy import Connection, func, select

from server.auth.roles import Role
from server.jobs.queue import JobView
from server.report.exports import parameter_row
from server.report.wording import TERMS
from server.services import analyses, jobs, live, reviews, sessions
from server.services.patients import Patient
from server.storage.blobs import BlobStore
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

NO_STRIDES: Final = {"kind": "bad", "text": "No strides"}

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


def patient_rows(c: Connection, found: Sequence[Patient]) -> list[dict[str, Any]]:
    """Rows of the patients list, each with the state of its latest visit."""
    rows = []
    streaming = {take.patient_id: take.session_id for take in live.streaming(c)}
    for p in found:
        visits = sessions.of_patient(c, p.id)
        running = _running(c, [v.id for v in visits]) if p.running else None
        last = status(visits[0].state) if visits else {"kind": "none", "text": "No session yet"}
        row = {"visits": p.sessions, "last": p.last_visit, "job": running, "status": last}
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
    for s in sessions.of_patient(c, patient_id):
        latest = analyses.latest(c, s.id) if results else None
        cells, strides = key_cells(_parameters(c, blobs, latest) if latest else [])
        rows.append(
            {
                **vars(s),
                "href": f"/sessions/{s.id}{_page_of(s, live=s.id in streaming)}",
                "live": s.id in streaming,
                "protocol_name": PROTOCOL_NAMES.get(s.protocol, s.protocol),
                "cells": cells,
                "strides": strides,
                "job": _running(c, [s.id]) if s.state == "running" else None,
                "status": NO_STRIDES if latest and not any((strides or {}).values()) else status(s.state),
            }
        )
    follow_few([row["job"] for row in rows])
    return rows


def _page_of(s: sessions.Session, *, live: bool) -> str:
    """The page of a session on which there is something to do."""
    if live:
        return "/live"
    return "/upload" if s.state in {"empty", "uploaded"} else ""


def _parameters(c: Connection, blobs: BlobStore, found: analyses.Analysis) -> Sequence[Mapping[str, Any]]:
    """Parameters as stored, or as a person's edits give them."""
    numbers = reviews.numbers(blobs, found, reviews.edits_of(c, found.id))
    return [parameter_row(p) for p in numbers.parameters]


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


def _running(c: Connection, session_ids: Sequence[str]) -> dict[str, Any] | None:
    """The running job of these sessions, else one that waits."""
    found = [j for sid in session_ids for j in jobs.of_session(c, sid) if not j.finished]
    found.sort(key=lambda j: j.state != "running")
    return job_dict(found[0]) if found else None
