"""Own controls and affected side in a report."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest

from sagittal.core.simulate import Stand, Straight, mt_files, simulate
from sagittal.server.processes.supervisor import Workers
from tests.helpers.clinic import Clinic, open_clinic

pytestmark = [pytest.mark.anyio, pytest.mark.slow]

API = "/api/v1"
SCRIPT = (Stand(5.0), Straight(12.8, 0.64, 0.54), Stand(4.0))
CONTROLS = 5


@pytest.fixture(scope="module")
async def clinic(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Clinic]:
    """Five controls and one patient, all analysed."""
    async with open_clinic(tmp_path_factory.mktemp("controls")) as result:
        workers = Workers(result.settings)
        workers.start()
        try:
            async with result.client("clinician", timeout=300) as client:
                for k in range(CONTROLS):
                    await analysed(client, k + 1, code=f"C-{k}", is_control=True)
                await analysed(client, 9, code="P-1", affected_side="right", birth_year=1970)
            yield result
        finally:
            workers.stop()


async def analysed(client: httpx.AsyncClient, seed: int, **person: Any) -> None:
    recording = simulate(SCRIPT, seed=seed)
    patient = (await client.post(f"{API}/patients", json={"height_m": 1.75, **person})).json()
    session = (await client.post(f"{API}/patients/{patient['id']}/sessions", json={})).json()
    for name, content in mt_files(recording.recording, "walk", recording.first_counter).items():
        await client.put(f"{API}/sessions/{session['id']}/files/{name}", content=content)
    body = {"manifest": {"sensors": dict(recording.recording.segments)}}
    job = (await client.post(f"{API}/sessions/{session['id']}/analyses", json=body)).json()
    answer = await client.get(f"{API}/jobs/{job['id']}/events")
    assert '"state":"done"' in answer.text.replace(" ", "").splitlines()[-2], answer.text[-400:]


async def report(clinic: Clinic, code: str) -> dict[str, Any]:
    async with clinic.client("clinician", timeout=60) as client:
        people = (await client.get(f"{API}/patients")).json()
        patient = next(p for p in people if p["code"] == code)
        (session,) = (await client.get(f"{API}/patients/{patient['id']}/sessions")).json()
        answer = await client.get(f"{API}/sessions/{session['id']}/report")
        assert answer.status_code == 200
        fields: dict[str, Any] = answer.json()
        return fields


async def change(clinic: Clinic, code: str, **values: Any) -> None:
    async with clinic.client("clinician") as client:
        people = (await client.get(f"{API}/patients")).json()
        patient = next(p for p in people if p["code"] == code)
        answer = await client.patch(f"{API}/patients/{patient['id']}", json=values)
        assert answer.status_code == 200


def row(result: dict[str, Any], name: str) -> dict[str, Any]:
    return next(r for r in result["parameters"] if r["name"] == name)


async def test_what_no_table_compares_is_held_against_own_controls(clinic: Clinic) -> None:
    result = await report(clinic, "P-1")
    path = row(result, "circumduction_m")
    assert path["norm_n"] == CONTROLS
    assert "controls of this clinic" in path["norm_source"]
    assert abs(path["left"]["z"]) < 5.0
    assert "own controls" in result["norm_note"]
    knee = row(result, "knee_flexion_rom_deg")
    assert "controls of this clinic" not in knee["norm_source"], "a published norm goes first"
    limits = [r for kind in ("beyond", "within") for r in result["limits"][kind]]
    assert any("own controls" in r["source"] for r in limits)


async def test_a_control_is_not_held_against_themselves_and_four_are_too_few(clinic: Clinic) -> None:
    result = await report(clinic, "C-0")
    assert row(result, "circumduction_m")["norm"] is None
    assert "too few" in result["norm_note"]


async def test_who_takes_the_agreement_back_is_no_control_any_more(clinic: Clinic) -> None:
    await change(clinic, "C-0", is_control=False)
    try:
        assert row(await report(clinic, "P-1"), "circumduction_m")["norm"] is None
    finally:
        await change(clinic, "C-0", is_control=True)


async def test_ratios_are_of_the_affected_over_the_other_side(clinic: Clinic) -> None:
    step = row(await report(clinic, "P-1"), "step_length_m")
    assert step["symmetry"]["reference"] == "affected/unaffected"
    assert step["symmetry"]["first"] == "right"
    ratio = step["right"]["value"] / step["left"]["value"]
    assert step["symmetry"]["ratio"] == pytest.approx(ratio)
    await change(clinic, "P-1", affected_side=None)
    step = row(await report(clinic, "P-1"), "step_length_m")
    assert step["symmetry"]["first"] == "left"
    await change(clinic, "P-1", affected_side="right")


async def test_a_side_that_nobody_has_is_refused(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        answer = await client.post(f"{API}/patients", json={"code": "X", "affected_side": "both"})
    assert answer.status_code == 422


async def test_a_target_of_feedback_is_that_of_own_controls_where_no_table_has_one(clinic: Clinic) -> None:
    async with clinic.client("clinician", timeout=60) as client:
        people = (await client.get(f"{API}/patients")).json()
        patient = next(p for p in people if p["code"] == "P-1")["id"]
        query = {"parameter": "foot_pitch_ic_deg", "side": "left"}
        offers = (await client.get(f"{API}/patients/{patient}/targets", params=query)).json()
    norm = next(o for o in offers if o["source"] == "norm")
    assert norm["mean"] is not None
    assert norm["sd"] > 0.0
    assert f"{CONTROLS} controls of this clinic" in norm["words"]
