"""Patients, visits and recordings put into a running server through its API."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

import httpx

from sagittal.core.simulate import mt_files, simulate_scenario
from tests.helpers.kept import keep


@keep
def simulated_files() -> tuple[Mapping[str, bytes], Mapping[str, str | None]]:
    """A simulated walk as MT Manager text by file name, and which sensor is on which segment."""
    simulation = simulate_scenario("comfortable", 1)
    return mt_files(simulation.recording, "walk"), dict(simulation.recording.segments)


def add(client: httpx.Client, path: str, **body: Any) -> dict[str, Any]:
    """Post JSON and return the answer."""
    answer = client.post(f"/api/v1{path}", json=body)
    assert answer.is_success, answer.text
    fields: dict[str, Any] = answer.json()
    return fields


def add_session(client: httpx.Client, patient_id: str, title: str, **more: Any) -> str:
    """A visit; returns its id."""
    day = more.pop("performed_on", "2026-11-18")
    session_id: str = add(client, f"/patients/{patient_id}/sessions", title=title, performed_on=day, **more)[
        "id"
    ]
    return session_id


def upload(client: httpx.Client, session_id: str, files: Mapping[str, bytes]) -> None:
    """Put every file into the session and wait until they have been looked at."""
    for name, content in files.items():
        answer = client.put(f"/api/v1/sessions/{session_id}/files/{quote(name)}", content=content)
        assert answer.status_code == 201, answer.text
    wait(client, add(client, f"/sessions/{session_id}/inspections")["id"])


def analyse(
    client: httpx.Client,
    session_id: str,
    sensors: Mapping[str, str | None],
    config: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Analyse with this mapping and wait for the end; returns the job."""
    requests = {"manifest": {"sensors": dict(sensors)}, "config": dict(config or {})}
    return wait(client, add(client, f"/sessions/{session_id}/analyses", **requests)["id"])


def wait(client: httpx.Client, job_id: str) -> dict[str, Any]:
    """Follow a job's events to its end; returns its last state."""
    job: dict[str, Any] = {}
    with client.stream("GET", f"/api/v1/jobs/{job_id}/events", timeout=120) as events:
        for line in events.iter_lines():
            if line.startswith("data: "):
                job = json.loads(line.removeprefix("data: "))
    assert job["state"] in {"done", "failed", "cancelled"}, job
    return job
