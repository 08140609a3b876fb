"""The report of an analysis as JSON and as tables."""

from __future__ import annotations

import csv
import io

import pytest

from sagittal.server.clinic import patients, sessions
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio
API = "/api/v1"


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text.lstrip("\ufeff"))))


async def test_json_and_tables_tell_the_same_numbers(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="RE-1").id
        session, empty = (sessions.create(c, None, patient).id for _ in range(2))
    done = analysed.finish(clinic, patient, session, analysed.files())
    address = f"{API}/sessions/{session}"
    async with clinic.client("viewer") as client:
        report = (await client.get(f"{address}/report")).json()
        parameters = await client.get(f"{address}/parameters.csv")
        curves = await client.get(f"{address}/curves.csv")
        body = (await client.get(f"{address}/parameters/stance_pct")).json()
        missing = [await client.get(f"{API}/sessions/{empty}/{label}") for label in ("report", "curves.csv")]
        unknown = await client.get(f"{address}/parameters/no_such_name")
        odd = await client.get(f"{address}/parameters/Stance")
    assert report["problem"] is None
    (row,) = [p for p in report["parameters"] if p["name"] == "stance_pct"]
    assert body["parameter"]["left"]["value"] == row["left"]["value"]
    used = [s for s in report["strides"] if s["side"] == "left" and s["used"]]
    assert row["left"]["n"] == len(used)
    assert len(body["strides"]) == len(report["strides"])
    assert f"parameters-{session[:8]}.csv" in parameters.headers["content-disposition"]
    assert f"curves-{session[:8]}.csv" in curves.headers["content-disposition"]
    table = [r for r in rows_of(parameters.text) if "stance_pct" in r.values()]
    assert table
    curve = [r for r in rows_of(curves.text) if "knee_flexion" in r.values() and "left" in r.values()]
    assert len(curve) == 101
    assert [a.status_code for a in (*missing, unknown, odd)] == [404, 404, 404, 422]
    async with clinic.client("assistant") as client:
        assert (await client.get(f"{address}/report")).status_code == 403
    async with clinic.client("admin") as client:
        rows = [r for r in (await client.get(f"{API}/audit")).json() if r["resource_id"] == session]
    assert {"report.opened", "parameter.opened"} <= {r["action"] for r in rows}
    assert {"analysis_id": done} in [r["detail"] for r in rows]
    assert {"parameter": "stance_pct"} in [r["detail"] for r in rows]
