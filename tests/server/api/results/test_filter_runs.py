"""Filters over the API: the list, references, comparisons and their files."""

from __future__ import annotations

from typing import Any

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.jobs.queue import COMPARE_FILTERS
from sagittal.server.report.words.filter_list import FILTERS
from sagittal.server.results import filter_runs
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio
API = "/api/v1"
REFERENCE = b"time\tpelvis_imu\n0.0\t1,0,0,0\n"


async def test_filters_are_listed_by_the_name_that_a_comparison_takes(clinic: Clinic) -> None:
    async with clinic.client("viewer") as client:
        listed = (await client.get(f"{API}/filters")).json()
    assert [f["name"] for f in listed] == [f.name for f in FILTERS]
    own = [f for f in listed if f["grade"] is None]
    assert {f["engine"] for f in own} == {"Sagittal"}
    assert {f["magnetometer"] for f in listed} <= {"needed", "optional", "unused"}
    assert all(f["paper"] is None or f["paper"]["doi"] is not None or f["paper"]["title"] for f in listed)


async def test_a_comparison_is_asked_for_once_and_read_with_its_files(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="FI-1").id
        session, empty = (sessions.create(c, None, patient).id for _ in range(2))
    done = analysed.finish(clinic, patient, session, analysed.files())
    address = f"{API}/sessions/{session}/filter-runs"
    async with clinic.client("clinician") as client:
        refused: tuple[dict[str, Any], ...] = (
            {"filters": []},
            {"filters": ["no_such_filter"]},
            {"filters": ["mahony_2008"], "speed": 2},
        )
        for wrong in refused:
            assert (await client.post(address, json=wrong)).status_code == 422, wrong
        requests = {"filters": ["mahony_2008"]}
        missing = await client.post(address, json=requests | {"reference": "none.sto"})
        assert missing.status_code == 404
        assert (await client.post(f"{API}/sessions/{empty}/filter-runs", json=requests)).status_code == 404
        first, second = [await client.post(address, json=requests) for _ in range(2)]
        assert (first.status_code, first.json()["kind"]) == (202, COMPARE_FILTERS)
        assert second.json()["id"] == first.json()["id"]
        assert (await client.get(address)).json() == []
        state = clinic.app.state
        claim = state.queue.claim("test", [COMPARE_FILTERS])
        stored = {"filters.json": state.blobs.put(patient, b"{}")}
        assert state.queue.finish(claim, lambda c: filter_runs.publish(c, claim, {}, stored))
        (run,) = (await client.get(address)).json()
        assert (run["analysis_id"], run["session_id"], run["job_id"]) == (done, session, first.json()["id"])
        assert [(f["name"], f["size"]) for f in run["files"]] == [("filters.json", 2)]
        one = f"{API}/filter-runs/{run['id']}"
        assert (await client.get(one)).json() == run
        file = await client.get(f"{one}/files/filters.json")
        assert (file.content, file.headers["content-type"]) == (b"{}", "application/json")
        assert f"filters-{run['id'][:8]}.json" in file.headers["content-disposition"]
        assert (await client.get(f"{one}/files/spread.csv")).status_code == 404
        assert (await client.get(f"{API}/filter-runs/{'0' * 32}")).status_code == 404


async def test_a_reference_is_kept_byte_for_byte_replaced_and_taken_away(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        session = sessions.create(c, None, patients.create(c, None, code="FI-2").id).id
    address = f"{API}/sessions/{session}/references"
    async with clinic.client("assistant") as client:
        added = await client.put(f"{address}/a/optical ä.sto", content=REFERENCE)
        assert added.status_code == 201, added.text
        assert (added.json()["name"], added.json()["size"]) == ("a/optical ä.sto", len(REFERENCE))
        newer = await client.put(f"{address}/a/optical ä.sto", content=REFERENCE * 2)
        assert newer.json()["sha256"] != added.json()["sha256"]
    async with clinic.client("viewer") as client:
        assert (await client.get(address)).json() == [newer.json()]
        file = await client.get(f"{address}/a/optical ä.sto")
        assert (file.content, file.headers["content-type"]) == (REFERENCE * 2, "application/octet-stream")
        assert 'filename="optical _.sto"' in file.headers["content-disposition"]
        assert (await client.delete(f"{address}/a/optical ä.sto")).status_code == 403
    async with clinic.client("assistant") as client:
        assert (await client.delete(f"{address}/a/optical ä.sto")).status_code == 204
        assert (await client.delete(f"{address}/a/optical ä.sto")).status_code == 404
