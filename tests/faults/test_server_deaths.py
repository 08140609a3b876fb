"""`sagittal serve` killed, stopped, and started twice on one data folder."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from server.processes.environment import make_environment
from tests.data import ROOT
from tests.faults.clinic import Clinic, alive, until

COMMAND = [
    sys.executable,
    "-c",
    "from server.main import main; raise SystemExit(main())",
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
            found = re.search(r"is at (http://\S+)", line)
            address = found and found[1]
        yield process, address
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def answers(address: str) -> bool:
    with urllib.request.urlopen(f"{address}/health/live", timeout=30) as answer:  # noqa: S310
        return bool(answer.status == 200)


def test_a_job_survives_the_kill_of_the_server(clinic: Clinic) -> None:
    view, reached, gate = clinic.hold("second")
    with serving(clinic) as (server, address):
        assert answers(address)
        until(reached.exists)
        child = int(reached.read_text())
        os.kill(server.pid, signal.SIGKILL)
        server.wait()
        until(lambda: not alive(child))
    gate.touch()
    with serving(clinic):
        done = clinic.ended(view)
    assert (done.state, done.attempt) == ("done", 2)
    assert len(clinic.results()) == 1


def test_a_second_server_on_the_same_folder_refuses(clinic: Clinic) -> None:
    with serving(clinic) as (server, address):
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
        assert answers(address)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_stopped_server_gives_its_job_back_within_ten_seconds(clinic: Clinic, number: int) -> None:
    view, reached, _ = clinic.hold("second")
    with serving(clinic) as (server, _):
        until(reached.exists)
        server.send_signal(number)
        server.wait(timeout=10)
    row = clinic.row(view)
    assert (row.state, row.deaths) == ("queued", 0)
    assert not alive(int(reached.read_text()))
