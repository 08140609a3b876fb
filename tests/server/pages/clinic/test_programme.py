"""The programme of a patient as a strip of weeks and a list."""

from __future__ import annotations

import datetime as dt
from typing import Any

import pytest

from sagittal.server.clinic import patients, programmes, sessions
from sagittal.server.clinic.programmes import PlannedVisit, Programme
from sagittal.server.pages.clinic.programme import STATE_WORDS, view_programme
from sagittal.server.storage.schema.tables import now
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio
MONDAY = dt.date(2026, 3, 2)


def planned(label: str, kind: Any, week: int, state: Any, days: int) -> PlannedVisit:
    return PlannedVisit(label, label, kind, week, MONDAY + dt.timedelta(days=days), None, None, state)


PLAN = Programme(
    "p", "1", "six_weeks", "Six weeks", MONDAY, now(),
    (
        planned("PRE", "assessment", 0, "done", -4),
        planned("T1", "training", 1, "done", 0),
        planned("T2", "training", 1, "missing", 2),
        planned("T3", "training", 3, "next", 14),
    ),
)  # fmt: skip


def test_weeks_are_counted_without_a_week_nought_and_one_of_them_is_now() -> None:
    view = view_programme(PLAN, MONDAY + dt.timedelta(days=13))
    assert [w["name"] for w in view["weeks"]] == ["wk \u22121", "wk 1", "now", "wk 3"]
    assert [w["gap"] for w in view["weeks"]] == [False, False, True, False]
    assert [w["name"] for w in view_programme(PLAN, MONDAY + dt.timedelta(days=14))["weeks"]][-2:] == [
        "wk 2",
        "now",
    ]
    assert view_programme(PLAN, MONDAY - dt.timedelta(days=1))["weeks"][0]["now"]
    assert not any(w["now"] for w in view_programme(PLAN, MONDAY + dt.timedelta(days=21))["weeks"])


def test_what_was_done_is_missing_and_comes_next_is_said() -> None:
    view = view_programme(PLAN, MONDAY)
    assert view["summary"] == "2 of 4 visits completed, 1 missing, next T3 on 16 Mar 2026"
    initial, first, empty, third = view["weeks"]
    assert first["words"] == "1 of 2 trainings completed, 1 missing"
    assert third["words"] == "0 of 1 training completed"
    assert empty["words"] == "0 of 0 trainings completed"
    assert ([v.label for v in initial["assessments"]], initial["trainings"]) == (["PRE"], [])
    assert [(v["label"], v["shape"], v["word"]) for v in view["visits"]] == [
        (v.label, *STATE_WORDS[v.state]) for v in PLAN.visits
    ]


async def test_the_page_offers_sessions_that_are_no_visit_yet(clinic: Clinic) -> None:
    today = now().date()
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="PG-1").id
        selection, free = (
            sessions.create(c, None, patient, title=t, performed_on=today).id for t in ("Taken", "Free")
        )
        plan = programmes.start(c, None, patient, starts_on=today)
        programmes.change_visit(c, None, plan.visits[0].id, {"session_id": selection})
    async with clinic.client("clinician") as client:
        page = (await client.get(f"/patients/{patient}/programme")).text
        none = (await client.get(f"/patients/{'0' * 32}/programme")).status_code
    assert page.count(f'value="{selection}"') == 1, "by the visit that it was"
    assert page.count(f'value="{free}"') == len(plan.visits)
    assert none == 404
