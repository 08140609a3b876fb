from __future__ import annotations

import csv
import io
import json
import logging
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pyarrow.parquet as pq
import pytest

from sagittal.core.simulate import Stand, Straight, mt_files, simulate
from sagittal.server.processes.supervisor import Workers
from sagittal.server.safekeeping import checks
from tests.helpers.clinic import Clinic, open_clinic

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
        self.first = ""
        """Id of the analysis, which is the only one until a test asks for another."""


def events(answer: httpx.Response) -> list[dict[str, Any]]:
    assert answer.headers["content-type"].startswith("text/event-stream")
    lines = answer.text.splitlines()
    return [json.loads(line.removeprefix("data: ")) for line in lines if line.startswith("data: ")]


@pytest.fixture(scope="module")
async def visit(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Visit]:
    simulation = simulate(SCRIPT, seed=3)
    async with open_clinic(tmp_path_factory.mktemp("visit")) as clinic:
        workers = Workers(clinic.settings)
        workers.start()
        try:
            async with clinic.client("clinician", timeout=300) as client:
                patient = (await client.post(f"{API}/patients", json={"code": CODE, "height_m": 1.75})).json()
                session = (await client.post(f"{API}/patients/{patient['id']}/sessions", json={})).json()
                this = Visit(clinic, session["id"])
                for name, content in mt_files(simulation.recording, "walk", simulation.first_counter).items():
                    stored = await client.put(f"{this.path}/files/{name}", content=content)
                    assert stored.status_code == 201
                job = (await client.post(f"{this.path}/inspections")).json()
                this.inspection = events(await client.get(f"{API}/jobs/{job['id']}/events"))
                body = {"manifest": {"sensors": dict(simulation.recording.segments)}}
                job = (await client.post(f"{this.path}/analyses", json=body)).json()
                this.analysis = events(await client.get(f"{API}/jobs/{job['id']}/events"))
                (made_first,) = (await client.get(f"{this.path}/analyses")).json()
                this.first = made_first["id"]
            yield this
        finally:
            workers.stop()


@pytest.mark.slow
async def test_progress_is_pushed_until_the_job_is_done(visit: Visit) -> None:
    for job in (visit.inspection, visit.analysis):
        assert job[-1]["state"] == "done", job[-1]
        assert job[-1]["fraction"] == 1.0
        attempts = [e["fraction"] for e in job if e["fraction"] is not None]
        assert attempts == sorted(attempts)
    assert visit.analysis[-1]["stage"] is not None


@pytest.mark.slow
async def test_what_was_found_is_in_the_recording(visit: Visit) -> None:
    async with visit.clinic.client("assistant") as client:
        body = (await client.get(f"{visit.path}/recording")).json()
    assert body["state"] == "ready"
    assert len(body["files"]) == 7
    assert len(body["inspection"]["devices"]) == 7


async def test_the_report_says_what_was_measured(visit: Visit) -> None:
    async with visit.clinic.client("viewer") as client:
        report = (await client.get(f"{visit.path}/report")).json()
        visible_body = (await client.get(f"{API}/sessions/{visit.session}")).json()
    assert visible_body["state"] == "done"
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
        (one,) = (a for a in listed if a["id"] == visit.first)
        analysis = (await client.get(f"{API}/analyses/{visit.first}")).json()
        assert analysis == one
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
        second_body = (await client.post(f"{visit.path}/analyses", json={})).json()
        assert second_body["id"] == visit.analysis[-1]["id"]
        assert second_body["state"] == "done"
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

        initial = await count()
        await client.get(f"{visit.path}/report")
        assert await count() == initial + 1


@pytest.mark.slow
async def test_every_page_about_a_person_leaves_one_audit_row(visit: Visit) -> None:
    clinic = visit.clinic
    async with clinic.client("admin", headers={"Accept": "text/html"}) as client:
        patient = (await client.get(f"{API}/sessions/{visit.session}")).json()["patient_id"]
        pages = {f"/patients/{patient}": patient, f"/patients/{patient}/sessions/new": patient}
        for tab in ("", "/upload", "/timeline", "/kinematics", "/algorithms", "/data", "/print"):
            pages[f"/sessions/{visit.session}{tab}"] = visit.session
        for page, resource in pages.items():
            initial_body = (await client.get(f"{API}/audit", params={"limit": 1})).json()[0]["seq"]
            assert (await client.get(page)).status_code == 200
            rows = (await client.get(f"{API}/audit", params={"limit": 5})).json()
            new = [r for r in rows if r["seq"] > initial_body]
            assert [(r["resource_id"], r["user_name"]) for r in new] == [(resource, "admin")], page


async def test_a_damaged_result_is_never_sent_and_is_named(
    visit: Visit, caplog: pytest.LogCaptureFixture
) -> None:
    async with visit.clinic.client("viewer") as client:
        analysis = (await client.get(f"{visit.path}/analyses")).json()[0]
        sha256 = next(f["sha256"] for f in analysis["files"] if f["name"] == "events.csv")
        path = next(p for p in visit.clinic.settings.blobs.rglob(sha256) if p.is_file())
        whole = path.read_bytes()
        _replace(path, whole[:-1] + b"!")
        answer = await client.get(f"{API}/analyses/{analysis['id']}/files/events.csv")
        assert (answer.status_code, answer.json()["code"]) == (503, "blob_damaged")
        assert answer.headers["content-type"] == "application/problem+json"
        [line] = [r for r in caplog.records if r.levelno >= logging.WARNING]
        assert sha256[:12] in line.getMessage()
        assert line.exc_info is None
        defects = checks.check(visit.clinic.db, visit.clinic.app.state.blobs, visit.clinic.settings)
        assert [d.area for d in defects if sha256[:12] in d.message] == ["files"]
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

        state, other_result = await run({"poses": {"estimator": "l7s_3i"}})
        assert (state, other_result["name"]) == ("done", "L7S-3I")
        assert "estimated by the leg model" in other_result["estimated"]
        state, second_result = await run({})
        assert (state, second_result) == ("done", first)
        state, _ = await run({"poses": {"estimator": "guess"}})
        assert state == "failed"
        jobs = (await client.get(f"{API}/jobs")).json()
        assert any(j["error_code"] == "unknown_estimator" for j in jobs)
        await run({})


async def reference_of(visit: Visit, client: httpx.AsyncClient) -> bytes:
    """The shanks' orientations of the analysis as a table of another system, whose clock is 2 s ahead."""
    analysis = (await client.get(f"{visit.path}/analyses")).json()[0]
    poses = await client.get(f"{API}/analyses/{analysis['id']}/files/poses.parquet")
    table = pq.read_table(io.BytesIO(poses.content))
    names = [f"shank_{side}_q_{part}" for side in "lr" for part in "wxyz"]
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["time", *names])
    columns = [table.column(name).to_pylist() for name in ("t_s", *names)]
    writer.writerows([t + 2.0, *q] for t, *q in zip(*columns, strict=True))
    return text.getvalue().encode()


async def compare(visit: Visit, client: httpx.AsyncClient, **body: Any) -> dict[str, Any]:
    """Run filters; the last event of the job."""
    requested_response = await client.post(
        f"{visit.path}/filter-runs", json={"filters": ["mahony_2008"], **body}
    )
    assert requested_response.status_code == 202
    return events(await client.get(f"{API}/jobs/{requested_response.json()['id']}/events"))[-1]


@pytest.mark.slow
async def test_filters_run_on_the_take_as_one_job_and_against_a_reference(visit: Visit) -> None:
    chosen = {"filters": ["mahony_2008", "wu_2018"], "magnetometer": False, "reference": "labor/optisch.csv"}
    async with visit.clinic.client("clinician", timeout=300) as client:
        content = await reference_of(visit, client)
        put = await client.put(f"{visit.path}/references/labor/optisch.csv", content=content)
        assert put.status_code == 201
        assert (await client.get(f"{visit.path}/references/labor/optisch.csv")).content == content
        # it is no part of the recording
        assert len((await client.get(f"{visit.path}/recording")).json()["files"]) == 7
        last = await compare(visit, client, **chosen)
        assert last["state"] == "done", last
        assert (await compare(visit, client, **chosen))["id"] == last["id"], "the same is run once"
        run = (await client.get(f"{visit.path}/filter-runs")).json()[0]
        assert (await client.get(f"{API}/filter-runs/{run['id']}")).json() == run
        assert run["reference_name"] == "labor/optisch.csv"
        files = f"{API}/filter-runs/{run['id']}/files"
        body = (await client.get(f"{files}/filters.json")).json()
        own, mahony, wu = body["filters"]
        assert (own["name"], own["label"], mahony["cost_us"] > 0.0) == (None, "Sagittal, as analysed", True)
        assert wu["to_median"] is None
        assert wu["label"] == "Wu2018 (reconstruction)"
        assert wu["told"][0]["code"] == "no_magnetometer"
        assert body["reference"]["lag_s"] == pytest.approx(-2.0, abs=0.01)
        assert all(s["total"] < 3.0 for s in body["reference"]["scores"])
        rows = list(csv.DictReader(io.StringIO((await client.get(f"{files}/reference.csv")).text)))
        assert {r["filter"] for r in rows} == {"Sagittal, as analysed", "Mahony2008"}
        page = await client.get(
            f"/sessions/{visit.session}/algorithms?of=shank_l&over=time&against=mahony_2008"
        )
        for text in (
            "Wu2018 (reconstruction)",
            "needs a magnetometer",
            "Left shank, inclination",
            "+1.96 SD",
        ):
            assert text in page.text


@pytest.mark.slow
async def test_a_reference_that_cannot_be_used_fails_the_job_with_a_reason(visit: Visit) -> None:
    async with visit.clinic.client("clinician", timeout=300) as client:
        await client.put(f"{visit.path}/references/bad.sto", content=b"DataType=double\nendheader\ntime\n0\n")
        last = await compare(visit, client, reference="bad.sto")
        assert (last["state"], last["error_code"]) == ("failed", "no_quaternions")
        page = await client.get(f"/sessions/{visit.session}/algorithms")
        assert "bad.sto is an OpenSim file without DataType=Quaternion" in page.text
        assert (await client.get(f"{API}/sessions/{visit.session}")).json()["state"] == "done"
        assert (await client.delete(f"{visit.path}/references/bad.sto")).status_code == 204
        listed = (await client.get(f"{visit.path}/references")).json()
        assert "bad.sto" not in [f["name"] for f in listed]
        for body, status in (
            ({"filters": []}, 422),
            ({"filters": ["kalman_1960"]}, 422),
            ({"filters": ["mahony_2008"], "reference": "bad.sto"}, 404),
        ):
            assert (await client.post(f"{visit.path}/filter-runs", json=body)).status_code == status


@pytest.mark.slow
async def test_who_reads_results_sees_comparisons_and_only_who_analyses_asks_for_one(visit: Visit) -> None:
    for role, asks, reads in (("viewer", 403, 200), ("assistant", 403, 403)):
        async with visit.clinic.client(role) as client:
            requested_response = await client.post(
                f"{visit.path}/filter-runs", json={"filters": ["mahony_2008"]}
            )
            assert requested_response.status_code == asks
            assert (await client.get(f"{visit.path}/filter-runs")).status_code == reads
            page = await client.get(f"/sessions/{visit.session}/algorithms")
            assert page.status_code == reads
            assert "Run on this trial" not in page.text
    async with visit.clinic.client("viewer") as client:
        assert (await client.put(f"{visit.path}/references/x.sto", content=b"x")).status_code == 403
        listed = (await client.get(f"{API}/filters")).json()
        assert len(listed) == 39
        assert all("reconstruction" in f["label"] for f in listed if f["grade"] == "C")
