"""A server started as a newcomer would, and how to talk to it over HTTP."""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.data import ROOT


@dataclass
class Service:
    """A server started as a newcomer would, its first administrator signed in."""

    process: subprocess.Popen[str]
    folder: Path
    client: httpx.Client


def line_with(process: subprocess.Popen[str], pattern: str) -> str:
    """First matching line of the server's standard output."""
    assert process.stdout is not None
    for line in process.stdout:
        if match := re.search(pattern, line):
            return match.group(0)
    pytest.fail(f"the server ended with {process.wait()} before it printed {pattern}")


@contextlib.contextmanager
def served(folder: Path) -> Iterator[Service]:
    """Run `sagittal serve` on a folder and set up its first administrator at the printed address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "sagittal.server.main", "serve", "--data", str(folder), "--port", "0"],
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
    response = client.post(
        f"/api/v1/patients/{patient['id']}/sessions", json={"title": "Walk", "height_m": 1.7}
    )
    return str(response.raise_for_status().json()["id"])


def upload(client: httpx.Client, session: str, name: str, content: bytes) -> None:
    client.put(f"/api/v1/sessions/{session}/files/{name}", content=content).raise_for_status()
