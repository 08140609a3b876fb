"""Two sessions compared over the API and the page: the earlier one first, whatever the order of naming."""

from __future__ import annotations

import csv
import datetime as dt
import io
from typing import Any

import pytest

from sagittal.server.clinic import patients, programmes, sessions
from sagittal.server.storage.schema.tables import new_id
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio

API = "/api/v1"


def _patient(clinic: Clinic) -> str:
    with clinic.db.write() as c:
        return patients.create(c, None, code=f"P-{new_id()[:8]}", height_m=1.75).id


def _session(
    clinic: Clinic, patient: str, days: int, protocol: str = "walk", duration_s: float = 12.0
) -> str:
    with clinic.db.write() as c:
        day = dt.date(2026, 3, 2) + dt.timedelta(days=days)
        result = sessions.create(c, None, patient, performed_on=day, protocol=protocol).id
    analysed.finish(clinic, patient, result, analysed.files(duration_s))
    return result


@pytest.mark.slow
async def test_the_earlier_session_comes_first_in_either_order(clinic: Clinic) -> None:
    patient = _patient(clinic)
    late, early = _session(clinic, patient, 30, duration_s=24.0), _session(clinic, patient, 0)
    async with clinic.client("viewer") as client:
        one = (await client.get(f"{API}/sessions/{late}/compare/{early}")).json()
        two = (await client.get(f"{API}/sessions/{early}/compare/{late}")).json()
        rows = (await client.get(f"{API}/sessions/{late}/compare/{early}/changes.csv")).text
        pages = [await client.get(f"/sessions/{a}/compare/{b}") for a, b in ((late, early), (early, late))]
    assert one == two
    assert (one["before"]["session_id"], one["after"]["session_id"]) == (early, late)
    stance = next(c for c in one["changes"] if (c["name"], c["side"]) == ("stance_pct", "left"))
    assert stance["verdict"] == "within_measurement_error"
    assert stance["words"] == "within measurement error"
    assert {c["name"] for c in one["changes"]} >= {"gps_sagittal_deg", "stride_time_s"}
    assert len(list(csv.DictReader(io.StringIO(rows)))) == len(one["changes"])
    assert [p.status_code for p in pages] == [200, 200]
    assert 'class="pvl"' in pages[0].text


def _since(report: dict[str, Any]) -> str | None:
    return None if report["since"] is None else report["since"]["session_id"]


@pytest.mark.slow
async def test_the_report_of_a_visit_says_what_changed_since_the_one_before(clinic: Clinic) -> None:
    patient = _patient(clinic)
    first, belt = _session(clinic, patient, 0), _session(clinic, patient, 3, protocol="treadmill")
    second = _session(clinic, patient, 9)
    async with clinic.client("viewer") as client:
        reports = [(await client.get(f"{API}/sessions/{s}/report")).json() for s in (first, belt, second)]
        page = (await client.get(f"/sessions/{second}")).text
    assert [_since(r) for r in reports] == [None, None, first]
    row = next(r for r in reports[2]["parameters"] if r["name"] == "stance_pct")
    assert [(w["side"], w["size"], w["mark"]) for w in row["change"]] == [
        ("left", "0.0", ""),
        ("right", "0.0", ""),
    ]
    assert f"/sessions/{second}/compare/{first}" in page


@pytest.mark.slow
async def test_an_assessment_is_compared_with_an_assessment_and_a_training_with_the_visit_before(
    clinic: Clinic,
) -> None:
    patient = _patient(clinic)
    pre, training, later = (_session(clinic, patient, days) for days in (0, 7, 9))
    mid = _session(clinic, patient, 30)
    with clinic.db.write() as c:
        plan = programmes.start(c, None, patient, starts_on=dt.date(2026, 3, 9))
        visits = {v.label: v.id for v in plan.visits}
        for label, session in (("PRE", pre), ("T1", training), ("T2", later), ("MID", mid)):
            programmes.change_visit(c, None, visits[label], {"session_id": session})
    async with clinic.client("viewer") as client:
        reports = [
            (await client.get(f"{API}/sessions/{s}/report")).json() for s in (pre, training, later, mid)
        ]
    assert [_since(r) for r in reports] == [None, pre, training, pre]


async def test_another_protocol_is_another_condition(clinic: Clinic) -> None:
    patient = _patient(clinic)
    walk, belt = _session(clinic, patient, 0), _session(clinic, patient, 7, protocol="treadmill")
    async with clinic.client("viewer") as client:
        body = (await client.get(f"{API}/sessions/{belt}/compare/{walk}")).json()
    assert not body["comparable"]
    assert any("over ground, then treadmill" in caution for caution in body["cautions"])


async def test_sessions_of_two_people_or_one_session_are_not_compared(clinic: Clinic) -> None:
    one, two = (_session(clinic, _patient(clinic), 0) for _ in range(2))
    async with clinic.client("viewer") as client:
        foreign = await client.get(f"{API}/sessions/{one}/compare/{two}")
        same = await client.get(f"{API}/sessions/{one}/compare/{one}")
        page = await client.get(f"/sessions/{one}/compare/{two}")
    assert (foreign.status_code, foreign.json()["code"]) == (409, "other_patient")
    assert (same.status_code, same.json()["code"]) == (409, "same_session")
    assert page.status_code == 409


async def test_two_ticked_visits_lead_to_their_comparison_and_others_back(clinic: Clinic) -> None:
    patient = _patient(clinic)
    one, two = _session(clinic, patient, 0), _session(clinic, patient, 7)
    async with clinic.client("viewer") as client:
        joint_response = await client.get(f"/patients/{patient}/compare", params={"visit": [one, two]})
        single = await client.get(f"/patients/{patient}/compare", params={"visit": [one]})
    assert joint_response.headers["location"] == f"/sessions/{one}/compare/{two}"
    assert single.headers["location"] == f"/patients/{patient}"


async def test_a_session_without_a_result_has_nothing_to_compare(clinic: Clinic) -> None:
    patient = _patient(clinic)
    done = _session(clinic, patient, 0)
    with clinic.db.write() as c:
        empty = sessions.create(c, None, patient).id
    async with clinic.client("viewer") as client:
        assert (await client.get(f"{API}/sessions/{done}/compare/{empty}")).status_code == 404


async def test_pages_of_trends_and_programme_open_for_everybody_who_may(clinic: Clinic) -> None:
    patient = _patient(clinic)
    async with clinic.client("viewer") as client:
        assert "No trend yet" in (await client.get(f"/patients/{patient}/trends")).text
        assert "No programme" in (await client.get(f"/patients/{patient}/programme")).text
    _session(clinic, patient, 0)
    async with clinic.client("viewer") as client:
        assert "one assessment so far" in (await client.get(f"/patients/{patient}/trends")).text
    async with clinic.client("assistant") as client:
        assert (await client.get(f"/patients/{patient}/programme")).status_code == 200
        assert (await client.get(f"/patients/{patient}/trends")).status_code == 403
        assert (await client.get(f"/patients/{patient}")).status_code == 200
