"""Sensitivity analyses over the API: asked for, computed as the worker does, read, cancelled, refused."""

from __future__ import annotations

import csv
import io
from typing import Any

import pytest

from sagittal.core.angles import JointAngles
from sagittal.core.formats import write_recording
from sagittal.core.formats.source import SourceFile
from sagittal.core.pipeline import analyse
from sagittal.core.simulate import RecordingSetup, Squats, SquatSimulation, simulate_squats
from sagittal.core.simulate.mems import MEMS
from sagittal.core.simulate.squat_chain import place_as_agreed
from sagittal.server.clinic import sessions
from sagittal.server.jobs.attempt import Attempt
from sagittal.server.jobs.queue import SENSITIVITY
from sagittal.server.report.files.exports import analysis_files, angles_parquet
from sagittal.server.results import sensitivities
from tests.core.body.chain.squats import HEIGHT_M
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio

API = "/api/v1"


@pytest.fixture(scope="module")
def made() -> SquatSimulation:
    squats = Squats(repetitions=1, other="lifted", hinged=True)
    setup = RecordingSetup(rate_hz=50.0, noise=MEMS)
    return simulate_squats(squats, HEIGHT_M, 0, setup, place_as_agreed(HEIGHT_M, squats.sides))


async def visit(clinic: Clinic, result: SquatSimulation, code: str, protocol: str = "squat") -> str:
    async with clinic.client("clinician") as client:
        patient = (await client.post(f"{API}/patients", json={"code": code})).json()["id"]
        requests = {"title": "Squats", "protocol": protocol}
        session: str = (await client.post(f"{API}/patients/{patient}/sessions", json=requests)).json()["id"]
    analysed.finish(clinic, patient, session, analysis_files(analyse(result.recording)))
    return session


def work(clinic: Clinic, session: str, result: SquatSimulation, *rest_of: SourceFile) -> list[str]:
    """Run the next job like a worker and its child, in this process; return the reported stages."""
    state, notices = clinic.app.state, list[str]()
    claim = state.queue.claim("tester", [SENSITIVITY])

    def say(stage: str, share: float, message: str | None = None) -> None:
        notices.append(stage)

    files = [SourceFile.of_bytes("recording.parquet", write_recording(result.recording)), *rest_of]
    results = sensitivities.run(files, claim.params, Attempt(say, lambda content: None))
    with clinic.db.read() as c:
        patient = sessions.get(c, session).patient_id
    stored = {name: state.blobs.put(patient, content) for name, content in results.items()}
    assert state.queue.finish(claim, lambda c: sensitivities.publish(c, claim, results, stored))
    return notices


@pytest.mark.slow
async def test_both_legs_against_themselves_and_against_a_reference(
    clinic: Clinic, made: SquatSimulation
) -> None:
    session = await visit(clinic, made, "sens")
    path = f"{API}/sessions/{session}/sensitivities"
    truth = angles_parquet(
        JointAngles(made.truth.t_s, made.truth.subtract_standing(), made.truth.zero_offset)
    )
    async with clinic.client("clinician") as client:
        job: dict[str, Any] = (await client.post(path, json={})).json()
        assert (job["kind"], job["state"]) == ("sensitivity", "queued")
        assert (await client.post(path, json={})).json()["id"] == job["id"], "the same is run once"
        assert (await client.get(path)).json() == []
        notices = work(clinic, session, made)
        assert list(dict.fromkeys(notices)) == ["analysis", "parameters"]
        [about] = (await client.get(path)).json()
        assert (about["id"], about["reference"], about["from_standing"]) == (job["id"], None, True)
        body = (await client.get(f"{API}/sensitivities/{about['id']}")).json()
        assert body["about"] == about
        legs = body["result"]["legs"]
        assert [leg["side"] for leg in legs] == ["left", "right"]
        assert all(len(leg["rows"]) == 24 and leg["error_deg"] == [0.0] * 7 for leg in legs)
        table = await client.get(f"{API}/analyses/{about['analysis_id']}/files/{about['files'][1]}")
        assert len(list(csv.DictReader(io.StringIO(table.text)))) == 2 * 24 * 7

        await client.put(f"{API}/sessions/{session}/references/optical.parquet", content=truth)
        requests = {"reference": "optical.parquet", "from_standing": False}
        assert (await client.post(path, json=requests)).json()["id"] != job["id"]
        work(clinic, session, made, SourceFile.of_bytes("optical.parquet", truth))
        newest = (await client.get(path)).json()[0]
        result = (await client.get(f"{API}/sensitivities/{newest['id']}")).json()["result"]
        assert result["reference"] == "optical.parquet"
        assert all(0.0 < leg["error_deg"][3] < 2.0 for leg in result["legs"])
        rows = {row["name"]: row for row in result["legs"][0]["rows"]}
        assert rows["Yaw-thi"]["reason"] == "parameter_nominal_zero"
        assert 1.0 < rows["Yaw-thi"]["delta_step_deg"][3] < 2.5

        page = (await client.get(f"/sessions/{session}/sensitivity?run={newest['id']}&show=quotient")).text
        assert "Left leg" in page
        assert "RMS error with nominal values" in page
        assert "optical.parquet" in page
        page = (await client.get(f"/sessions/{session}/sensitivity?run={job['id']}")).text
        assert "Sensor misalignment matters most" in page
        assert "RMS error with nominal" not in page
    async with clinic.client("assistant") as client:
        assert (await client.post(path, json={})).status_code == 403


@pytest.mark.slow
async def test_it_is_cancelled_like_other_jobs(clinic: Clinic, made: SquatSimulation) -> None:
    session = await visit(clinic, made, "stopped")
    async with clinic.client("clinician") as client:
        path = f"{API}/sessions/{session}/sensitivities"
        job = (await client.post(path, json={})).json()
        assert "Sensitivity analysis" in (await client.get(f"/sessions/{session}/sensitivity")).text
        assert (await client.post(f"{API}/jobs/{job['id']}/cancel")).json()["state"] == "cancelled"
        assert (await client.get(path)).json() == []
        assert (await client.get(f"{API}/sensitivities/{job['id']}")).status_code == 404


@pytest.mark.slow
async def test_what_cannot_be_analysed_is_refused(clinic: Clinic, made: SquatSimulation) -> None:
    session = await visit(clinic, made, "walks", protocol="walk")
    second = await visit(clinic, made, "squats")
    async with clinic.client("clinician") as client:
        refused = await client.post(f"{API}/sessions/{session}/sensitivities", json={})
        assert (refused.status_code, refused.json()["code"]) == (409, "not_squats")
        path = f"{API}/sessions/{second}/sensitivities"
        assert (await client.post(path, json={"reference": "none.parquet"})).status_code == 404
        assert (await client.post(path, json={"legs": 2})).status_code == 422
        assert (
            "Sensitivity is analysed for squats"
            in (await client.get(f"/sessions/{session}/sensitivity")).text
        )
