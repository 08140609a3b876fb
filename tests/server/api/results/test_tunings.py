"""Tunings over the API: asked for, computed by the task, and read as JSON."""

from __future__ import annotations

from typing import Any

import pytest

from sagittal.core.formats.source import SourceFile
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.jobs.queue import TUNE
from sagittal.server.results import analyses, tunings
from sagittal.server.uploads.recordings import ANALYSE
from tests.core.fusion.algorithms.motion import trial_bytes
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio

API = "/api/v1"
TRIALS = {"a.npz": trial_bytes(2.0), "judge.npz": trial_bytes(2.5)}
ORDER = {
    "algorithm": "mahony_2008", "validation": ["judge"], "scheme": "fixed", "particles": 3, "iterations": 2,
    "rounds": 2, "random_rounds": 1,
}  # fmt: skip


async def session_with_trials(clinic: Clinic, code: str) -> str:
    async with clinic.client("clinician") as client:
        patient = (await client.post(f"{API}/patients", json={"code": code})).json()["id"]
        session: str = (await client.post(f"{API}/patients/{patient}/sessions", json={})).json()["id"]
        for name, content in TRIALS.items():
            answer = await client.put(f"{API}/sessions/{session}/files/{name}", content=content)
            assert answer.status_code == 201
    return session


def work(clinic: Clinic, job_id: str) -> list[tuple[str, float, str | None]]:
    """Run the next job like a worker and its child, in this process; return the progress messages."""
    queue, text = clinic.app.state.queue, []
    claim = queue.claim("tester", [TUNE])
    assert claim.job_id == job_id
    stored_chunks: list[bytes] = []

    def say(stage: str, share: float, message: str | None = None) -> None:
        text.append((stage, share, message))

    files = [SourceFile.of_bytes(name, content) for name, content in TRIALS.items()]
    content = tunings.run(files, claim.params, Attempt(say, stored_chunks.append))
    assert len(stored_chunks) == 6
    assert tunings.run(files, claim.params, Attempt(say, stored_chunks.append, stored_chunks[2])) == content
    assert (
        tunings.run(files, claim.params, Attempt(say, stored_chunks.append, b"of another version")) == content
    )
    assert queue.finish(claim, lambda c: tunings.publish(c, claim, content, {}))
    return text


@pytest.mark.slow
async def test_a_tuning_is_asked_for_and_its_result_is_downloaded(clinic: Clinic) -> None:
    session = await session_with_trials(clinic, "tuned")
    async with clinic.client("clinician") as client:
        path = f"{API}/sessions/{session}/tunings"
        job: dict[str, Any] = (await client.post(path, json=ORDER)).json()
        assert (job["kind"], job["state"]) == ("tune", "queued")
        assert (await client.post(path, json=ORDER)).json()["id"] == job["id"]
        assert (await client.get(f"{API}/sessions/{session}")).json()["state"] == "uploaded"
        text = work(clinic, job["id"])
        assert text[0][0] == "reading"
        assert text[6][:2] == ("searching", 1.0)
        assert str(text[6][2]).startswith("Round 2 of 2, ")
        [body] = (await client.get(path)).json()
        assert body["job_id"] == job["id"]
        assert set(body["result"]["data"]) == {"a", "judge"}
        assert len(body["result"]["data_sha256"]) == 64
        assert (await client.get(f"{API}/tunings/{body['id']}")).json() == body
        # what was tuned on stays as it was
        initial = body["recording_id"]
        await client.put(f"{API}/sessions/{session}/files/more.npz", content=b"x")
        assert (await client.get(f"{API}/sessions/{session}/recording")).json()["id"] != initial
    async with clinic.client("assistant") as client:
        assert (await client.post(path, json=ORDER)).status_code == 403
        assert (await client.get(path)).status_code == 403


async def test_an_analysis_goes_first(clinic: Clinic) -> None:
    session = await session_with_trials(clinic, "first")
    async with clinic.client("clinician") as client:
        tuning = (await client.post(f"{API}/sessions/{session}/tunings", json=ORDER)).json()["id"]
    with clinic.db.write() as c:
        analysis = analyses.submit(c, clinic.app.state.queue, None, session).id
    queue, kinds = clinic.app.state.queue, [TUNE, ANALYSE]
    assert [queue.claim("tester", kinds).job_id for _ in range(2)] == [analysis, tuning]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "status", "code"),
    [
        ({"validation": ["nobody"]}, 409, "no_such_trial"),
        ({"algorithm": "kalman_1960"}, 422, "no_such_algorithm"),
        ({"algorithm": "sagittal_live"}, 422, "nothing_to_tune"),
        ({"validation": []}, 422, None),
        ({"validation": [f"t{i}" for i in range(101)]}, 422, None),
        ({"particles": 10**9}, 422, None),
        ({"scheme": "fuzzy"}, 422, None),
        ({"particles": 0}, 422, None),
        ({"swarm": 1}, 422, None),
    ],
)
async def test_what_cannot_be_tuned_is_refused_at_once(
    clinic: Clinic, change: dict[str, Any], status: int, code: str | None
) -> None:
    session = await session_with_trials(clinic, f"refused {sorted(change)} {len(str(change))}")
    async with clinic.client("clinician") as client:
        answer = await client.post(f"{API}/sessions/{session}/tunings", json=ORDER | change)
    assert answer.status_code == status
    if code is not None:
        assert answer.json()["code"] == code
