"""Study tables over selected visits."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from typing import Any

import httpx
import pyarrow.parquet as pq
import pytest

from sagittal.server.downloads import study_maker
from tests.helpers.clinic import PASSWORD, Clinic
from tests.server.api.downloads.test_exports import API, visit

pytestmark = pytest.mark.anyio


def unpack(answer: httpx.Response) -> dict[str, bytes]:
    assert answer.status_code == 200, answer.text
    with zipfile.ZipFile(io.BytesIO(answer.content)) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def rows(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(content.decode())))


@pytest.mark.sweep
async def test_the_tables_have_every_visit_as_it_counts_by_pseudonyms(clinic: Clinic) -> None:
    first, second = await visit(clinic, "JANE-DOE"), await visit(clinic, "JOHN-DOE")
    async with clinic.client("clinician") as client:
        patient = (await client.get(f"{API}/sessions/{second}")).json()["patient_id"]
        requested_fields: dict[str, Any] = {"title": "Jane Doe", "performed_on": "2026-03-12", "note": "Jane"}
        empty = (await client.post(f"{API}/patients/{patient}/sessions", json=requested_fields)).json()["id"]
        initial = unpack(await client.get(f"{API}/study.zip"))
        item = next(row for row in rows(initial["strides.csv"]) if not row["excluded_reason"])
        edit = {"kind": "exclude_stride", "side": item["side"], "reason": "Jane stumbled"}
        edit["time_s"] = (float(item["start_s"]) + float(item["end_s"])) / 2  # type: ignore[assignment]
        (await client.post(f"{API}/sessions/{first}/edits", json=edit)).raise_for_status()
        result = unpack(await client.get(f"{API}/study.zip"))
        single = unpack(await client.get(f"{API}/study.zip", params={"visit": [first]}))
        later = unpack(await client.get(f"{API}/study.zip", params={"since": "2026-03-12"}))
        page = (await client.get("/study", params={"q": "JANE", "protocol": "walk"})).text
        refused = [
            await client.get(f"{API}/study.zip", params=bad)
            for bad in (
                {"until": "1999-01-01"},
                {"since": "yesterday"},
                {"protocol": "fly"},
                {"visit": ["x"]},
                {"ticked": True},  # each tick was taken away: nothing, not everything
            )
        ]
    async with clinic.client("viewer") as client:
        assert (await client.get(f"{API}/study.zip")).status_code == 403
    async with clinic.client("admin") as client:
        trail = (await client.get(f"{API}/audit", params={"limit": 1000})).json()

    takes = rows(result["takes.csv"])
    assert len(takes) == 3
    assert sorted(t["error"] for t in takes) == ["", "", "no_analysis"]
    assert sorted(t["days_since_first"] for t in takes if t["sub"] == takes[-1]["sub"]) == ["0", "10"]
    assert pq.read_table(io.BytesIO(result["takes.parquet"])).num_rows == 3
    (failed,) = rows(result["failures.csv"])
    assert failed["message"].startswith("This visit has no analysis")
    for name, content in result.items():
        for secret in ("DOE", "Jane", "2026-03", first, second, empty):
            if name != "provenance.json" or secret != "2026-03":
                assert secret.encode() not in content, (name, secret)
    # one visit has an edit: its stride does not count, and its figures are those without it
    left_out = [r for r in rows(result["strides.csv"]) if r["excluded_reason"] == "manual"]
    assert len(left_out) == 1
    assert [t["edits"] for t in takes if t["take"] == left_out[0]["take"]] == ["1"]
    assert len(rows(result["strides.csv"])) == len(rows(initial["strides.csv"]))
    assert {r["take"] for r in rows(single["strides.csv"])} == {left_out[0]["take"]}
    assert [t["error"] for t in rows(later["takes.csv"])] == ["no_analysis"]
    document = json.loads(result["provenance.json"])
    assert len(document["takes"]) == 3
    assert len(document["analyses"]) == 2
    assert (page.count('name="visit"'), "JOHN-DOE" in page) == (1, False)
    assert [a.status_code for a in refused] == [409, 422, 422, 422, 409]
    about = [row["resource_id"] for row in trail if row["action"] == "study.exported"]
    assert sorted(about) == sorted([first, second, empty] * 2 + [first, empty])


async def test_a_study_stops_nobody_else_and_says_why_there_is_none(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    await visit(clinic, "JILL-DOE")
    monkeypatch.setattr(study_maker, "LONGEST_S", 0.0)
    async with clinic.client("clinician", raises=False) as client:
        late = await client.get(f"{API}/study.zip")
    monkeypatch.setattr(study_maker, "run_errand", cut_off)
    async with clinic.client("clinician", raises=False) as client:
        died = await client.get(f"{API}/study.zip")
        own = {"name": "R", "scopes": ["read", "write"], "days": 1, "password": PASSWORD}
        token = (await client.post(f"{API}/account/tokens", json=own)).json()["token"]
    async with clinic.client(headers={"authorization": f"Bearer {token}"}) as script:
        by_token = await script.get(f"{API}/study.zip")
    assert [(a.status_code, a.json()["code"]) for a in (late, died)] == [(503, "study_failed")] * 2
    assert "Choose fewer visits" in late.json()["detail"]
    assert by_token.status_code == 403


def cut_off(*_: object) -> bytes:
    """What happens to a line whose other end has gone."""
    raise EOFError
