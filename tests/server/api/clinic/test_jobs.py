from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator

import httpx
import pytest

from sagittal.server.api.clinic.jobs import _events
from sagittal.server.auth import access
from sagittal.server.jobs.feed import JobFeed
from sagittal.server.jobs.queue import Claim, JobView
from tests.helpers.clinic import Clinic
from tests.helpers.engines import on_both_engines
from tests.server.serving import serve

pytestmark = [pytest.mark.anyio, on_both_engines]

API = "/api/v1"


async def queued_job(clinic: Clinic, code: str) -> str:
    """A job that no worker takes unless a test does."""
    async with clinic.client("clinician") as client:
        patient = (await client.post(f"{API}/patients", json={"code": code})).json()["id"]
        session = (await client.post(f"{API}/patients/{patient}/sessions", json={})).json()["id"]
        await client.put(f"{API}/sessions/{session}/files/a.csv", content=b"t\n")
        answer = await client.post(f"{API}/sessions/{session}/inspections")
        assert answer.status_code == 202
        second_response = await client.post(f"{API}/sessions/{session}/inspections")
    job: str = answer.json()["id"]
    assert second_response.json()["id"] == job
    return job


@pytest.mark.slow
async def test_a_session_without_files_has_nothing_to_inspect_or_analyse(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        patient = (await client.post(f"{API}/patients", json={"code": "empty"})).json()["id"]
        session = (await client.post(f"{API}/patients/{patient}/sessions", json={})).json()["id"]
        for path in ("inspections", "analyses"):
            answer = await client.post(f"{API}/sessions/{session}/{path}", json={})
            assert (answer.status_code, answer.json()["code"]) == (409, "no_files")
        for path in ("recording", "report", "curves.csv"):
            assert (await client.get(f"{API}/sessions/{session}/{path}")).status_code == 404


@pytest.mark.slow
async def test_every_change_is_pushed_and_the_stream_ends_with_the_job(clinic: Clinic) -> None:
    job = await queued_job(clinic, "pushed")
    observations: list[tuple[str, str | None]] = []
    async with serve(clinic.app) as port:
        cookies = {"sid": clinic.token("viewer")}
        async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", cookies=cookies) as client:
            async with client.stream("GET", f"{API}/jobs/{job}/events") as stream:
                assert stream.headers["content-type"].startswith("text/event-stream")
                claim: Claim | None = None
                async for line in stream.aiter_lines():
                    if not line.startswith("data: "):
                        continue
                    view = json.loads(line.removeprefix("data: "))
                    observations.append((view["state"], view["stage"]))
                    queue = clinic.app.state.queue
                    if view["state"] == "queued":
                        while claim is None or claim.job_id != job:
                            claim = queue.claim("tester", ["inspect"])
                        queue.progress(claim, "reading", 0.5, "Reading a.csv")
                    elif view["stage"] == "reading":
                        queue.fail(claim, "no_format", "No format fits; give a manifest.")
            listed = (await client.get(f"{API}/jobs/{job}")).json()
    assert observations[0] == ("queued", None)
    assert ("running", "reading") in observations
    assert observations[-1] == ("failed", "reading")
    assert listed["error_code"] == "no_format"
    assert listed["patient_code"] == "pushed"


async def test_a_queued_job_is_cancelled_at_once_and_only_active_ones_are_listed(clinic: Clinic) -> None:
    job = await queued_job(clinic, "cancelled")
    async with clinic.client("assistant") as client:
        active = (await client.get(f"{API}/jobs", params={"active": True})).json()
        assert job in {j["id"] for j in active}
        answer = await client.post(f"{API}/jobs/{job}/cancel")
        assert (answer.status_code, answer.json()["state"]) == (202, "cancelled")
        active = (await client.get(f"{API}/jobs", params={"active": True})).json()
        assert job not in {j["id"] for j in active}
        assert job in {j["id"] for j in (await client.get(f"{API}/jobs")).json()}
        assert (await client.post(f"{API}/jobs/{'0' * 32}/cancel")).status_code == 404
        assert (await client.get(f"{API}/jobs/{'0' * 32}/events")).status_code == 404


@pytest.mark.slow
async def test_watching_does_not_write_audit_rows(clinic: Clinic) -> None:
    job = await queued_job(clinic, "quiet")
    async with clinic.client("admin") as client:
        await client.post(f"{API}/jobs/{job}/cancel")
        initial_body = (await client.get(f"{API}/audit", params={"limit": 1})).json()[0]["seq"]
        await client.get(f"{API}/jobs/{job}/events")
        assert (await client.get(f"{API}/audit", params={"limit": 1})).json()[0]["seq"] == initial_body


async def test_a_stream_ends_with_the_sign_in_however_busy_the_job_is(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = await queued_job(clinic, "busy")
    monkeypatch.setattr(access, "CHECK_EVERY_S", 0.0)
    signed_in = iter((None, None))

    class BusyFeed(JobFeed):
        """A job that changes without a pause."""

        async def watch(self, job_id: str) -> AsyncIterator[JobView]:
            view = self._read({job_id})[job_id]
            while True:
                yield view
                await asyncio.sleep(0)

    async with asyncio.timeout(60):
        stream = _events(BusyFeed(clinic.db), job, lambda: next(signed_in, "not_signed_in"))
        lines = [line async for line in stream if line.startswith("data: ")]
    assert lines
    async with clinic.client("admin") as client:
        await client.post(f"{API}/jobs/{job}/cancel")
