from __future__ import annotations

import csv
import io
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pyarrow.parquet as pq
import pytest

from core.simulate import Stand, Straight, mt_files, simulate
from server.processes.supervisor import Workers
from tests.server.clinic import Clinic, open_clinic

pytestmark = pytest.mark.anyio

API = "/api/v1"
CODE = "PATIENT-CANARY-4711"
SCRIPT = (Stand(5.0), Straight(12.8, 0.64, 0.54), Stand(4.0))


class Visit:
    """An analysed session: seven simulated sensors, uploaded and computed by a real worker."""

    def __init__(self, clinic: Clinic, session: str) -> None:
        self.clinic = clinic
        self.session = session
        self.path = f"{API}/sessions/{session}"
        self.inspection: list[dict[str, Any]] = []
        self.analysis: list[dict[str, Any]] = []


def events(answer: httpx.Response) -> list[dict[str, Any]]:
    assert answer.headers["content-type"].startswith("text/event-stream")
    lines = answer.text.splitlines()
    return [json.loads(line.removeprefix("data: ")) for line in lines if line.startswith("data: ")]


@pytest.fixture(scope="module")
async def visit(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Visit]:
    made = simulate(SCRIPT, seed=3)
    async with open_clinic(tmp_path_factory.mktemp("visit")) as clinic:
        workers = Workers(clinic.settings)
        workers.start()
        try:
            async with clinic.client("clinician", timeout=300) as client:
                patient = (await client.post(f"{API}/patients", json={"code": CODE, "height_m": 1.75})).json()
                session = (await client.post(f"{API}/patients/{patient['id']}/sessions", json={})).json()
                this = Visit(clinic, session["id"])
                for name, content in mt_files(made.recording, "walk", made.first_counter).items():
                    stored = await client.put(f"{this.path}/files/{name}", content=content)
                    assert stored.status_code == 201
                job = (await client.post(f"{this.path}/inspections")).json()
                this.inspection = events(await client.get(f"{API}/jobs/{job['id']}/events"))
                body = {"manifest": {"sensors": dict(made.recording.segments)}}
                job = (await client.post(f"{this.path}/analyses", json=body)).json()
                this.analysis = events(await client.get(f"{API}/jobs/{job['id']}/events"))
            yield this
        finally:
            workers.stop()


async def test_progress_is_pushed_until_the_job_is_done(visit: Visit) -> None:
    for job in (visit.inspection, visit.analysis):
        assert job[-1]["state"] == "done", job[-1]
        assert job[-1]["fraction"] == 1.0
        attempts = [e["fraction"] for e in job if e["fraction"] is not None]
        assert attempts == sorted(attempts)
    assert {e["stage"] for e in visit.analysis} - {None}


async def test_what_was_found_is_in_the_recording(visit: Visit) -> None:
    async with visit.clinic.client("assistant") as client:
        found = (await client.get(f"{visit.path}/recording")).json()
    assert found["state"] == "ready"
    assert len(found["files"]) == 7
    assert len(found["inspection"]["devices"]) == 7


async def test_the_report_says_what_was_measured(visit: Visit) -> None:
    async with visit.clinic.client("viewer") as client:
        report = (await client.get(f"{visit.path}/report")).json()
        shown = (await client.get(f"{API}/sessions/{visit.session}")).json()
    assert shown["state"] == "done"
    assert report["problem"] is None
    stride_time = next(p for p in report["parameters"] if p["name"] == "stride_time_s")
    assert 0.9 < stride_time["left"]["value"] < 1.3
    assert len(report["curves"]) >= 9
    assert report["strides"]


async def test_every_table_has_a_csv_twin(visit: Visit) -> None:
    async with visit.clinic.client("viewer") as client:
        for name in ("parameters", "curves"):
            answer = await client.get(f"{visit.path}/{name}.csv")
            assert answer.headers["content-type"] == "text/csv; charset=utf-8"
            assert f'filename="{name}-{visit.session[:8]}.csv"' in answer.headers["content-disposition"]
            rows = list(csv.DictReader(io.StringIO(answer.text)))
            assert len(rows) > 10
            assert "nan" not in answer.text.lower()


async def test_downloads_are_the_stored_bytes_and_never_name_the_patient(visit: Visit) -> None:
    types = {
        "analysis.json": "application/json",
        "angles.parquet": "application/vnd.apache.parquet",
        "poses.parquet": "application/vnd.apache.parquet",
        "tracks.parquet": "application/vnd.apache.parquet",
        "signals.parquet": "application/vnd.apache.parquet",
        "events.csv": "text/csv; charset=utf-8",
        "strides.csv": "text/csv; charset=utf-8",
    }
    async with visit.clinic.client("viewer") as client:
        listed = (await client.get(f"{visit.path}/analyses")).json()
        assert len(listed) == 1
        analysis = (await client.get(f"{API}/analyses/{listed[0]['id']}")).json()
        assert analysis == listed[0]
        assert {f["name"] for f in analysis["files"]} == set(types)
        for file in analysis["files"]:
            answer = await client.get(f"{API}/analyses/{analysis['id']}/files/{file['name']}")
            assert len(answer.content) == file["size"]
            assert answer.headers["content-type"] == types[file["name"]]
            assert CODE not in answer.headers["content-disposition"]
            assert CODE.encode() not in answer.content
            if file["name"].endswith(".parquet"):
                assert pq.read_table(io.BytesIO(answer.content)).num_rows > 1000
        for name in ("nothing.json", "..%2Fanalysis.json"):
            answer = await client.get(f"{API}/analyses/{analysis['id']}/files/{name}")
            assert answer.status_code == 404


async def test_the_same_analysis_is_computed_once(visit: Visit) -> None:
    async with visit.clinic.client("clinician") as client:
        again = (await client.post(f"{visit.path}/analyses", json={})).json()
        assert again["id"] == visit.analysis[-1]["id"]
        assert again["state"] == "done"
        wrong = await client.post(f"{visit.path}/analyses", json={"manifest": {"sensors": {"x": "nose"}}})
        assert (wrong.status_code, wrong.headers["content-type"]) == (422, "application/problem+json")


async def test_a_result_is_for_those_who_may_read_results(visit: Visit) -> None:
    async with visit.clinic.client("assistant") as client:
        for path in ("report", "curves.csv", "analyses"):
            assert (await client.get(f"{visit.path}/{path}")).status_code == 403
        assert (await client.get(f"{visit.path}/recording")).status_code == 200


async def test_opening_a_report_is_audited_once(visit: Visit) -> None:
    async with visit.clinic.client("admin") as client:

        async def count() -> int:
            rows = (await client.get(f"{API}/audit", params={"limit": 1000})).json()
            return sum(r["action"] == "report.opened" for r in rows)

        before = await count()
        await client.get(f"{visit.path}/report")
        assert await count() == before + 1


async def test_every_page_about_a_person_leaves_one_audit_row(visit: Visit) -> None:
    clinic = visit.clinic
    async with clinic.client("admin", headers={"Accept": "text/html"}) as client:
        patient = (await client.get(f"{API}/sessions/{visit.session}")).json()["patient_id"]
        pages = {f"/patients/{patient}": patient, f"/patients/{patient}/sessions/new": patient}
        for tab in ("", "/upload", "/timeline", "/kinematics", "/data", "/print"):
            pages[f"/sessions/{visit.session}{tab}"] = visit.session
        for page, resource in pages.items():
            before = (await client.get(f"{API}/audit", params={"limit": 1})).json()[0]["seq"]
            assert (await client.get(page)).status_code == 200
            rows = (await client.get(f"{API}/audit", params={"limit": 5})).json()
            new = [r for r in rows if r["seq"] > before]
            assert [(r["resource_id"], r["user_name"]) for r in new] == [(resource, "admin")], page


async def test_a_damaged_result_is_never_sent(visit: Visit) -> None:
    async with visit.clinic.client("viewer") as client:
        analysis = (await client.get(f"{visit.path}/analyses")).json()[0]
        sha256 = next(f["sha256"] for f in analysis["files"] if f["name"] == "events.csv")
        path = next(p for p in visit.clinic.settings.blobs.rglob(sha256) if p.is_file())
        whole = path.read_bytes()
        _replace(path, whole[:-1] + b"!")
        answer = await client.get(f"{API}/analyses/{analysis['id']}/files/events.csv")
        assert (answer.status_code, answer.json()["code"]) == (500, "blob_damaged")
        _replace(path, whole)
        assert (await client.get(f"{API}/analyses/{analysis['id']}/files/events.csv")).content == whole


def _replace(path: Path, content: bytes) -> None:
    path.chmod(0o600)
    path.write_bytes(content)


async def test_another_estimator_runs_on_the_same_take_and_the_first_can_be_shown_again(visit: Visit) -> None:
    async with visit.clinic.client("clinician", timeout=300) as client:
        first = (await client.get(f"{visit.path}/report")).json()["estimator"]
        assert first["name"] == "ErKF, smoothed"

        async def run(config: dict[str, Any]) -> tuple[str, dict[str, Any]]:
            job = (await client.post(f"{visit.path}/analyses", json={"config": config})).json()
            last = events(await client.get(f"{API}/jobs/{job['id']}/events"))[-1]
            return last["state"], (await client.get(f"{visit.path}/report")).json()["estimator"]

        state, other = await run({"poses": {"estimator": "l7s_3i"}})
        assert (state, other["name"]) == ("done", "L7S-3I")
        assert "estimated by the leg model" in other["estimated"]
        state, again = await run({})
        assert (state, again) == ("done", first)
        state, _ = await run({"poses": {"estimator": "guess"}})
        assert state == "failed"
        jobs = (await client.get(f"{API}/jobs")).json()
        assert any(j["error_code"] == "unknown_estimator" for j in jobs)
        await run({})
