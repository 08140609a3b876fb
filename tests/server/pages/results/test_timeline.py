"""Strides, events and signals over time."""

from __future__ import annotations

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.pages.shell import FRAGMENT
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


async def test_numbers_follow_an_edit_and_only_who_may_review_edits(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="TI-1").id
        session, empty = (sessions.create(c, None, patient).id for _ in range(2))
    analysed.finish(clinic, patient, session, analysed.files())
    path = f"/sessions/{session}/timeline"
    requests = {FRAGMENT: "numbers"}
    async with clinic.client("clinician") as client:
        page = await client.get(path)
        without = await client.get(f"/sessions/{empty}/timeline")
        plain = await client.get(f"{path}/numbers")
        initial_response = await client.get(f"{path}/numbers", headers=requests)
        report = (await client.get(f"/api/v1/sessions/{session}/report")).json()
        used, every = sum(s["used"] for s in report["strides"]), len(report["strides"])
        stride = next(s for s in report["strides"] if s["used"])
        edit = {
            "kind": "exclude_stride", "side": stride["side"], "reason": "Stumbled",
            "time_s": (stride["start_s"] + stride["end_s"]) / 2,
        }  # fmt: skip
        done = await client.post(f"/api/v1/sessions/{session}/edits", json=edit)
        assert done.is_success, done.text
        final_response = await client.get(f"{path}/numbers", headers=requests)
    assert (page.status_code, without.status_code) == (200, 200)
    assert (plain.status_code, plain.headers["location"]) == (303, f"{path}#numbers")
    assert f"{used} of {every} included" in initial_response.text
    assert f"{used - 1} of {every} included" in final_response.text
    assert "<html" not in initial_response.text
    async with clinic.client("assistant") as client:
        assert (await client.get(path)).status_code == 403
    async with clinic.client("admin") as client:
        rows = (await client.get("/api/v1/audit")).json()
    assert [r["resource_id"] for r in rows if r["action"] == "numbers.opened"] == [session]
