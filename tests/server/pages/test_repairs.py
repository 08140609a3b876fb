"""A wrong set-up on the pages: proposed, confirmed with one click, and undone by an earlier one."""

from __future__ import annotations

import html
import json
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from sagittal.server.results.analysing import REPAIRED
from tests.helpers.clinic import Clinic, open_clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio

STATED = {"sensors": {"A": "foot_l", "B": "foot_r"}}
CORRECTED = {"A": {"gyr_axes": ["-x", "-y", "-z"]}}
SETUP = {"kind": "axes", "evidence": ["The gyroscope of foot_l is turned."], "margin": 9.0}


@pytest.fixture
async def clinic(tmp_path: Path) -> AsyncIterator[Clinic]:
    async with open_clinic(tmp_path) as running:
        yield running


async def walk(clinic: Clinic) -> str:
    """Session of a walk whose analysis proposes a repair."""
    async with clinic.client("admin") as client:
        patient = (await client.post("/api/v1/patients", json={"code": "R-1"})).json()["id"]
        session = (await client.post(f"/api/v1/patients/{patient}/sessions", json={"title": "Walk"})).json()
    result = json.loads(analysed.files()["analysis.json"]) | {"setup": SETUP}
    repaired = {**STATED, "protocol": "walk", "subject": {"height_m": 1.7}, "corrections": CORRECTED}
    files = {
        **analysed.files(),
        "analysis.json": json.dumps(result).encode(),
        REPAIRED: json.dumps(repaired).encode(),
    }
    analysed.finish(clinic, patient, session["id"], files, STATED)
    return str(session["id"])


async def read(clinic: Clinic, path: str, role: str = "admin") -> str:
    async with clinic.client(role) as client:
        return (await client.get(path)).text


def find_hidden(page: str, name: str) -> Any:
    match = re.search(rf'name="{name}" data-type="json"\s+value="([^"]*)"', page)
    return None if match is None else json.loads(html.unescape(match[1]))


async def test_the_proposal_is_shown_and_holds_the_set_up_alone(clinic: Clinic) -> None:
    session = await walk(clinic)
    page = await read(clinic, f"/sessions/{session}")
    assert "The gyroscope of left foot is turned." in page
    assert "Of sensor A its rates are taken with all signs turned round." in page
    # height and protocol stay those of the session
    assert find_hidden(page, "manifest") == {**STATED, "corrections": CORRECTED}
    assert find_hidden(await read(clinic, f"/sessions/{session}", "viewer"), "manifest") is None


@pytest.mark.slow
async def test_confirming_it_asks_for_an_analysis_and_the_earlier_set_up_can_be_asked_for_again(
    clinic: Clinic,
) -> None:
    session = await walk(clinic)
    manifest = find_hidden(await read(clinic, f"/sessions/{session}"), "manifest")
    async with clinic.client("admin") as client:
        requested_response = await client.post(
            f"/api/v1/sessions/{session}/analyses", json={"manifest": manifest}
        )
        assert requested_response.status_code == 202
    analysed.publish_next(clinic, session)
    assert find_hidden(await read(clinic, f"/sessions/{session}"), "manifest") is None
    page = await read(clinic, f"/sessions/{session}/data")
    assert find_hidden(page, "manifest") == STATED
    async with clinic.client("admin") as client:
        body = {"manifest": STATED, "config": find_hidden(page, "config")}
        assert (await client.post(f"/api/v1/sessions/{session}/analyses", json=body)).status_code == 202
    # nothing has to run again: the stored result counts
    assert find_hidden(await read(clinic, f"/sessions/{session}"), "manifest") == {
        **STATED,
        "corrections": CORRECTED,
    }
