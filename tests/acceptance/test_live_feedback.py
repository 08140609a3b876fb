"""A training from the prescription to its report: streamed, told stride by stride, recorded, analysed."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import Any

import httpx
import pytest

from sagittal.core.online import compile_live_kernels
from sagittal.server.demo.clinic import PRESCRIBED
from sagittal.server.demo.live import plan_training, stream_walk
from tests.helpers.service import served

SPEED = 6.0
"""The walk is streamed so much faster than it was walked."""


@pytest.mark.slow
def test_a_training_with_feedback_ends_in_a_report_of_what_was_told(tmp_path: Path) -> None:
    # compiled before the server starts, or its estimator would still compile when the walk is over
    compile_live_kernels()
    person, content = PRESCRIBED
    with served(tmp_path / "clinic") as service:
        client = service.client
        about = {"code": person.code, "height_m": person.height_m, "affected_side": "left"}
        patient = _made(client, "/patients", about)["id"]
        _made(client, f"/patients/{patient}/prescriptions", dict(content))
        session = _made(client, f"/patients/{patient}/sessions", {"title": "Training"})["id"]
        code = _made(client, f"/sessions/{session}/live", {})["code"]
        asyncio.run(
            stream_walk(str(client.base_url).rstrip("/"), code, plan_training(laps=3).recording, SPEED)
        )
        found = _result(client, session)
        page = client.get(f"/sessions/{session}").raise_for_status().text
    rows = {r["kind"]: r for r in found["rows"]}
    assert rows["baseline"]["n"] >= 8, "nothing was known of him: his first strides say where to begin"
    assert rows["with"]["n"] > 20
    assert rows["probe"]["n"] >= 6
    assert [p["number"] for p in found["probes"]][:1] == [1]
    assert not any("no stride in the analysis" in note for note in found["notes"])
    apart = [s["live_value"] - s["value"] for s in found["strides"]]
    assert max(map(abs, apart)) < 0.1, "what he was told is what he walked"
    assert all(s["shown"] == (s["why_not"] is None) for s in found["strides"])
    assert {e["name"] for e in found["effects"]} == {"other_side", "gps_sagittal_deg"}
    assert found["retention"] is None
    assert "With feedback" in page


def _made(client: httpx.Client, path: str, content: dict[str, Any]) -> dict[str, Any]:
    answer = client.post(f"/api/v1{path}", json=content)
    assert answer.is_success, answer.text
    made: dict[str, Any] = answer.json()
    return made


def _result(client: httpx.Client, session: str) -> dict[str, Any]:
    end = time.monotonic() + 240.0
    while True:
        found: dict[str, Any] = client.get(f"/api/v1/sessions/{session}/feedback").raise_for_status().json()
        if found["reason"] is None:
            return found
        assert time.monotonic() < end, found["reason"]
        time.sleep(1.0)
