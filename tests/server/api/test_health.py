"""Health of the process and its components, without sign-in."""

from __future__ import annotations

import pytest

from sagittal.server.storage.readiness import Readiness
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


async def test_a_well_server_says_so_without_a_sign_in(clinic: Clinic) -> None:
    async with clinic.client() as client:
        live, ready = await client.get("/health/live"), await client.get("/health/ready")
    assert (live.status_code, live.json()) == (200, {"status": "ok", "checks": {}})
    assert (ready.status_code, ready.json()["status"]) == (200, "ok")
    assert len(ready.json()["checks"]) >= 3
    assert set(ready.json()["checks"].values()) == {"ok"}


async def test_one_part_that_does_not_work_is_named_and_the_answer_is_503(clinic: Clinic) -> None:
    state, usual = clinic.app.state, clinic.app.state.readiness
    parts = {"worker": lambda: "No worker lives.", "views": lambda: "ok"}
    state.readiness = Readiness(clinic.settings, clinic.db, state.blobs, parts=parts)
    try:
        async with clinic.client() as client:
            ready, live = await client.get("/health/ready"), await client.get("/health/live")
    finally:
        state.readiness = usual
    assert (ready.status_code, ready.json()["status"]) == (503, "failing")
    body = ready.json()["checks"]
    assert (body.pop("worker"), set(body.values())) == ("No worker lives.", {"ok"})
    assert live.status_code == 200
