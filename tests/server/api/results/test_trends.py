"""Trends over the API: analysed visits in order, edits followed, and a table of the same."""

from __future__ import annotations

import csv
import datetime as dt
import io
from typing import Any

import pytest

from sagittal.core.frames import Protocol
from sagittal.server.clinic import patients, sessions
from sagittal.server.storage.schema.tables import new_id
from tests.helpers.clinic import Clinic
from tests.helpers.engines import on_both_engines
from tests.server import analysed, walk

pytestmark = [pytest.mark.anyio, on_both_engines]

API = "/api/v1"


def _add(clinic: Clinic, patient: str, days: int, protocol: str = "walk", duration_s: float = 12.0) -> str:
    with clinic.db.write() as c:
        day = dt.date(2026, 3, 2) + dt.timedelta(days=days)
        session = sessions.create(c, None, patient, performed_on=day, protocol=protocol).id
    analysed.finish(clinic, patient, session, analysed.files(duration_s))
    return session


@pytest.fixture
async def patient(clinic: Clinic) -> str:
    with clinic.db.write() as c:
        code = f"P-{new_id()[:8]}"
        return patients.create(c, None, code=code, height_m=1.75, birth_year=1960, sex="male").id


def _trend(answer: dict[str, Any], name: str) -> dict[str, Any]:
    fields: dict[str, Any] = next(t for t in answer["trends"] if t["name"] == name)
    return fields


async def test_visits_come_oldest_first_with_their_change_against_the_first(
    clinic: Clinic, patient: str
) -> None:
    later, first = _add(clinic, patient, 30, duration_s=24.0), _add(clinic, patient, 0)
    async with clinic.client("viewer") as client:
        answer = (await client.get(f"{API}/patients/{patient}/trends")).json()
    assert [v["session_id"] for v in answer["visits"]] == [first, later]
    lines = _trend(answer, "stance_pct")["lines"]
    assert [line["side"] for line in lines] == ["left", "right"]
    assert lines[0]["points"][0]["change"] is None
    assert lines[0]["points"][1]["change"]["verdict"] == "within_measurement_error"
    assert "Kesar" in lines[0]["points"][1]["change"]["limit_source"]
    assert {line["side"] for line in _trend(answer, "gps_sagittal_deg")["lines"]} == {"left", "right"}


@pytest.mark.parametrize("protocol", ["tug", "squat", "walk_6min", "activity"])
async def test_a_later_test_does_not_hide_how_somebody_walks(
    clinic: Clinic, patient: str, protocol: Protocol
) -> None:
    walked = _add(clinic, patient, 0)
    _add(clinic, patient, 7, protocol)
    async with clinic.client("viewer") as client:
        answer = (await client.get(f"{API}/patients/{patient}/trends")).json()
        page = (await client.get(f"/patients/{patient}")).text
    assert [v["session_id"] for v in answer["visits"]] == [walked]
    assert answer["protocol"] == "walk"
    assert "Progress" in page


async def test_an_edit_moves_the_point_of_its_visit(clinic: Clinic, patient: str) -> None:
    session = _add(clinic, patient, 0)
    _add(clinic, patient, 7)
    path = f"{API}/patients/{patient}/trends?show=stride_time_s"
    contact = walk.events().times("left", "ic")[3]
    edit = {"kind": "exclude_stride", "side": "left", "time_s": contact + 0.5, "reason": "stumbled"}
    async with clinic.client("clinician") as client:
        initial = _trend((await client.get(path)).json(), "stride_time_s")["lines"][0]["points"]
        assert (await client.post(f"{API}/sessions/{session}/edits", json=edit)).status_code == 201
        final = _trend((await client.get(path)).json(), "stride_time_s")["lines"][0]["points"]
        assert (await client.delete(f"{API}/sessions/{session}/edits")).status_code == 200
        undone = _trend((await client.get(path)).json(), "stride_time_s")["lines"][0]["points"]
    assert final[0]["n"] == initial[0]["n"] - 1
    assert final[1] == initial[1] | {"change": final[1]["change"]}
    assert undone == initial


async def test_visits_of_another_protocol_are_asked_for(clinic: Clinic, patient: str) -> None:
    walked, belt = _add(clinic, patient, 9), _add(clinic, patient, 0, protocol="treadmill")
    async with clinic.client("viewer") as client:
        for query, expected in (("", walked), ("?protocol=treadmill", belt)):
            answer = (await client.get(f"{API}/patients/{patient}/trends{query}")).json()
            assert [v["session_id"] for v in answer["visits"]] == [expected]


async def test_limits_are_those_of_the_affected_limb(clinic: Clinic, patient: str) -> None:
    _add(clinic, patient, 0)
    path = f"{API}/patients/{patient}"
    async with clinic.client("clinician") as client:
        unknown = (await client.get(f"{path}/trends?show=hip_flexion_rom_deg")).json()["trends"][0]["lines"]
        assert (await client.patch(path, json={"affected_side": "left"})).status_code == 200
        known_body = (await client.get(f"{path}/trends?show=hip_flexion_rom_deg")).json()["trends"][0][
            "lines"
        ]
    # Guzik 2021: MCID 5.81° of the affected, 2.86° of the unaffected hip; the larger where nobody knows
    assert [line["mcid"] for line in unknown] == [5.81, 5.81]
    assert [line["mcid"] for line in known_body] == [5.81, 2.86]


async def test_the_table_has_a_row_for_every_figure_side_and_visit(clinic: Clinic, patient: str) -> None:
    _add(clinic, patient, 0)
    _add(clinic, patient, 7)
    async with clinic.client("viewer") as client:
        answer = await client.get(f"{API}/patients/{patient}/trends.csv?show=stance_pct&show=cadence_spm")
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert [(r["name"], r["side"], r["date"]) for r in rows if r["name"] == "stance_pct"] == [
        ("stance_pct", "left", "2026-03-02"),
        ("stance_pct", "left", "2026-03-09"),
        ("stance_pct", "right", "2026-03-02"),
        ("stance_pct", "right", "2026-03-09"),
    ]
    assert rows[0]["mdc"] == ""
    assert {r["name"] for r in rows} == {"stance_pct", "cadence_spm"}


async def test_who_may_not_see_results_sees_no_trend(clinic: Clinic, patient: str) -> None:
    async with clinic.client("assistant") as client:
        assert (await client.get(f"{API}/patients/{patient}/trends")).status_code == 403


async def test_a_patient_without_a_result_has_an_empty_trend(clinic: Clinic, patient: str) -> None:
    async with clinic.client("viewer") as client:
        answer = (await client.get(f"{API}/patients/{patient}/trends")).json()
    assert answer == {"protocol": None, "condition": None, "visits": [], "others": [], "trends": []}


async def test_a_planned_training_is_a_small_dot(clinic: Clinic, patient: str) -> None:
    session = _add(clinic, patient, 0)
    async with clinic.client("clinician") as client:
        body = {"starts_on": "2026-03-02"}
        payload = (await client.post(f"{API}/patients/{patient}/programmes", json=body)).json()
        first = next(v for v in payload["visits"] if v["label"] == "T1")
        linked = await client.patch(f"{API}/planned-visits/{first['id']}", json={"session_id": session})
        assert linked.status_code == 200
        answer = (await client.get(f"{API}/patients/{patient}/trends")).json()
        assert [(v["label"], v["kind"]) for v in answer["visits"]] == [("T1", "training")]
        second_response = await client.post(f"{API}/patients/{patient}/programmes", json=body)
        assert (second_response.status_code, second_response.json()["code"]) == (409, "programme_running")
        new = {"title": "Second training", "planned_visit_id": payload["visits"][2]["id"]}
        assert (await client.post(f"{API}/patients/{patient}/sessions", json=new)).status_code == 201
        known_body = (await client.get(f"{API}/patients/{patient}/programmes")).json()
        assert [v["label"] for v in known_body[0]["visits"] if v["state"] == "done"] == ["T1", "T2"]
        assert (await client.delete(f"{API}/programmes/{payload['id']}")).status_code == 204
