"""The service from the printed set-up address to the check: the same numbers as the command line."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.acceptance.test_cli import NEURA, result, sagittal
from tests.data import ROOT, data_folder


@dataclass
class Service:
    """A server started as a newcomer would, its first administrator signed in."""

    process: subprocess.Popen[str]
    folder: Path
    client: httpx.Client


def line_with(process: subprocess.Popen[str], pattern: str) -> str:
    """The first printed line that matches; the server says nothing else on stdout."""
    assert process.stdout is not None
    for line in process.stdout:
        if found := re.search(pattern, line):
            return found.group(0)
    pytest.fail(f"the server ended with {process.wait()} before it printed {pattern}")


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("clinic") / "data"
    process = subprocess.Popen(
        [sys.executable, "-m", "server.main", "serve", "--data", str(folder), "--port", "0"],
        cwd=ROOT, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    try:
        address = line_with(process, r"http://\S+/set-up/\S+")
        base, _, token = address.partition("/set-up/")
        with httpx.Client(base_url=base, timeout=120) as client:
            person = {"name": "grace", "password": "a few unrelated words"}
            client.post(f"/api/v1/set-up/{token}", json=person).raise_for_status()
            yield Service(process, folder, client)
    finally:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()


def wait_for(client: httpx.Client, job_id: str) -> dict[str, Any]:
    """The last state the server pushes for a job."""
    state: dict[str, Any] = {}
    with client.stream("GET", f"/api/v1/jobs/{job_id}/events", timeout=300) as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        for line in stream.iter_lines():
            if line.startswith("data:"):
                state = json.loads(line[5:])
    return state


def new_session(client: httpx.Client, code: str) -> str:
    patient = client.post("/api/v1/patients", json={"code": code}).raise_for_status().json()
    made = client.post(f"/api/v1/patients/{patient['id']}/sessions", json={"title": "Walk", "height_m": 1.7})
    return str(made.raise_for_status().json()["id"])


def upload(client: httpx.Client, session: str, name: str, content: bytes) -> None:
    client.put(f"/api/v1/sessions/{session}/files/{name}", content=content).raise_for_status()


def test_a_set_up_address_works_once(service: Service) -> None:
    again = service.client.post(
        "/api/v1/set-up/guess", json={"name": "eve", "password": "long enough to pass"}
    )
    assert again.status_code == 404
    assert again.headers["content-type"] == "application/problem+json"


def test_neura_walk_through_rest_equals_the_command_line(service: Service, tmp_path: Path) -> None:
    folder = data_folder("neura_walk", "rawimu")
    client = service.client
    session = new_session(client, "P-1 🚶")
    for file in sorted(folder.glob("*.txt")):
        upload(client, session, file.name, file.read_bytes())

    job = client.post(f"/api/v1/sessions/{session}/inspections").raise_for_status().json()
    assert wait_for(client, job["id"])["state"] == "done"
    found = client.get(f"/api/v1/sessions/{session}/recording").raise_for_status().json()
    assert len(found["files"]) == 11
    assert "duplicate" in json.dumps(found["inspection"])

    client.put(f"/api/v1/sessions/{session}/manifest", json={"sensors": NEURA["sensors"]}).raise_for_status()
    job = client.post(f"/api/v1/sessions/{session}/analyses", json={}).raise_for_status().json()
    last = wait_for(client, job["id"])
    assert last["state"] == "done", last
    analyses = client.get(f"/api/v1/sessions/{session}/analyses").raise_for_status().json()
    address = f"/api/v1/analyses/{analyses[0]['id']}/files"
    served = client.get(f"{address}/analysis.json").raise_for_status().json()

    manifest = tmp_path / "manifest.json"
    manifest.write_text(json.dumps(NEURA), "utf-8")
    done = sagittal("analyse", folder, "--manifest", manifest, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert served["parameters"] == result(tmp_path / "out")["parameters"]
    for name in ("angles.parquet", "poses.parquet", "events.csv", "strides.csv"):
        assert client.get(f"{address}/{name}").content == (tmp_path / "out" / name).read_bytes(), name


def test_an_unreadable_recording_fails_with_a_sentence_and_the_next_one_works(service: Service) -> None:
    client = service.client
    session = new_session(client, "P-2")
    upload(client, session, "notes.txt", b"dear diary, today nobody walked\n")
    job = client.post(f"/api/v1/sessions/{session}/analyses", json={}).raise_for_status().json()
    last = wait_for(client, job["id"])
    assert last["state"] == "failed"
    assert len(last["error_message"] or last["message"]) > 30
    assert client.get(f"/sessions/{session}").status_code == 200


def test_the_server_ends_within_ten_seconds_and_all_is_well(service: Service) -> None:
    began = time.monotonic()
    service.process.send_signal(signal.SIGTERM)
    assert service.process.wait(15) == 0
    assert time.monotonic() - began < 10
    checked = sagittal("check", "--data", service.folder)
    assert checked.returncode == 0, checked.stdout
    assert "All is well" in checked.stdout
