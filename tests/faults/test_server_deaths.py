"""`sagittal serve` killed, stopped, and started twice on one data folder."""

from __future__ import annotations

import datetime as dt
import hashlib
import os
import re
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import httpx
import numpy as np
import pytest

from sagittal.server.auth import accounts
from sagittal.server.auth.passwords import hash_password
from sagittal.server.auth.roles import Role
from sagittal.server.auth.sessions import Logins
from sagittal.server.processes.environment import make_environment
from sagittal.server.uploads import recordings
from tests.data import ROOT
from tests.faults.clinic import Clinic, alive, until
from tests.faults.forking import ForkedServer, Forker
from tests.helpers.engines import on_both_engines

pytestmark = on_both_engines

COMMAND = [
    sys.executable,
    "-c",
    "from sagittal.server.main import main; raise SystemExit(main())",
    "serve",
    "--port",
    "0",
]


@contextmanager
def serving(clinic: Clinic) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A real server and its address."""
    process = subprocess.Popen(
        COMMAND, env=make_environment(clinic.settings), cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    try:
        address = None
        while address is None:
            line = process.stdout.readline()
            assert line, f"the server ended with {process.wait()}"
            match = re.search(r"is at (http://\S+)", line)
            address = match and match[1]
        yield process, address
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def answers(address: str) -> bool:
    with urllib.request.urlopen(f"{address}/health/live", timeout=30) as answer:  # noqa: S310
        return bool(answer.status == 200)


@pytest.mark.death
def test_a_job_survives_the_kill_of_the_server(clinic: Clinic, forker: Forker) -> None:
    view, reached, gate = clinic.hold("second")
    with forker.start(clinic.settings).running() as server:
        assert answers(server.address)
        until(reached.exists)
        child = int(reached.read_text())
        server.kill()
        until(lambda: not alive(child))
    gate.touch()
    with forker.start(clinic.settings).running():
        done = clinic.ended(view)
    assert (done.state, clinic.row(view).attempt) == ("done", 2)
    assert len(clinic.results()) == 1


def test_a_second_server_on_the_same_folder_refuses(clinic: Clinic, forker: Forker) -> None:
    with forker.start(replace(clinic.settings, workers=0)).running() as server:
        second = subprocess.run(
            COMMAND,
            env=make_environment(clinic.settings),
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert second.returncode == 1
        assert f"process {server.pid}" in second.stderr
        assert answers(server.address)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_stopped_server_gives_its_job_back_within_ten_seconds(
    clinic: Clinic, forker: Forker, number: int
) -> None:
    view, reached, _ = clinic.hold("second")
    with forker.start(clinic.settings).running() as server:
        until(reached.exists)
        os.kill(server.pid, number)
        server.wait(patience_s=10)
    row = clinic.row(view)
    assert (row.state, row.deaths) == ("queued", 0)
    assert not alive(int(reached.read_text()))


@pytest.mark.death
def test_an_upload_in_parts_goes_on_after_kills_with_the_same_bytes(clinic: Clinic, forker: Forker) -> None:
    content = np.random.default_rng(19).bytes(12_000_000)
    with clinic.db.write() as c:
        user = accounts.create(c, "grace", None, Role.CLINICIAN, hash_password("a few unrelated words")).id
        hour = dt.timedelta(hours=1)
        token = Logins(clinic.db, hour, hour).start(c, user, None)
    path = f"/api/v1/sessions/{clinic.session.id}/uploads"
    reached, without_workers = 0, replace(clinic.settings, workers=0)
    for kill_at in (2_000_000, 7_000_000, None):
        with (
            forker.start(without_workers).running() as server,
            httpx.Client(base_url=server.address, cookies={"sid": token}, timeout=60) as client,
        ):
            announced = {"name": "large.csv", "size": len(content)}
            upload = client.post(path, json=announced).raise_for_status().json()
            assert upload["offset"] >= reached, "what was there is there again"
            mine = f"{path}/{upload['id']}"
            body = _dying(server, content, upload["offset"], kill_at, clinic.blobs.part(upload["id"]))
            headers = {"Upload-Offset": str(upload["offset"])}
            if kill_at is not None:
                with pytest.raises(httpx.TransportError):
                    client.patch(mine, content=body, headers=headers)
                reached = kill_at - 1_000_000
                continue
            assert client.patch(mine, content=body, headers=headers).json()["offset"] == len(content)
            end = {"sha256": hashlib.sha256(content).hexdigest()}
            client.post(f"{mine}/finish", json=end).raise_for_status()
    with clinic.db.read() as c:
        stored = {f.name: f for f in recordings.require_current(c, clinic.session.id).files}
    assert clinic.blobs.read(clinic.patient.id, stored["large.csv"].sha256) == content


def _dying(
    server: ForkedServer, content: bytes, start: int, kill_at: int | None, part: Path
) -> Iterator[bytes]:
    """Bytes from a position on; kills the server midway once the earlier bytes are stored."""
    for index in range(start, len(content), 250_000):
        if kill_at and index >= kill_at:
            until(lambda: part.exists() and part.stat().st_size >= kill_at - 1_000_000)
            server.kill()
        yield content[index : index + 250_000]
