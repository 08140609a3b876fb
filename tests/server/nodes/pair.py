"""Two web servers on one PostgreSQL database and one data folder, as an administrator starts them."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from sagittal.server.settings import Settings
from tests.data import ROOT
from tests.helpers.service import line_with

LEASE_S = 6.0
PASSWORD = "a few unrelated words"


@dataclass
class RunningNode:
    """Web server process. said : its output when it became ready."""

    settings: Settings
    process: subprocess.Popen[str]
    client: httpx.Client = field(init=False)

    def __post_init__(self) -> None:
        # a line that is kept open would be closed by whoever is killed
        self.client = httpx.Client(base_url=self.address, timeout=30, headers={"Connection": "close"})

    def start_again(self) -> None:
        """Start it after a kill, and wait until it answers."""
        self.process.communicate()
        self.process = start_process(self.settings)
        line_with(self.process, "Sagittal is at")

    @property
    def address(self) -> str:
        return self.settings.node_address

    @property
    def socket(self) -> str:
        return f"ws://127.0.0.1:{self.settings.port}"

    def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()


def find_ports(n: int) -> list[int]:
    with contextlib.ExitStack() as exit_stack:
        enter_contexts = [exit_stack.enter_context(socket.socket()) for _ in range(n)]
        for one in enter_contexts:
            one.bind(("127.0.0.1", 0))
        return [int(one.getsockname()[1]) for one in enter_contexts]


def describe(folder: Path, url: str, name: str, port: int) -> Settings:
    return Settings(
        data_dir=folder, database_url=url, port=port, workers=0, live_workers=0, lease_s=LEASE_S,
        node_name=name, node_address=f"http://127.0.0.1:{port}",
    )  # fmt: skip


def start_process(settings: Settings) -> subprocess.Popen[str]:
    """Start one; it does not answer yet."""
    return subprocess.Popen(
        [sys.executable, "-m", "sagittal.server.main", "serve"],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, **settings.environment(), "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip


@dataclass
class NodePair:
    """Both, with a signed-in administrator at each: one sign-in, one cookie."""

    a: RunningNode
    b: RunningNode

    @property
    def both(self) -> tuple[RunningNode, RunningNode]:
        return self.a, self.b

    @property
    def cookie(self) -> str:
        return self.a.client.cookies["sid"]


@contextlib.contextmanager
def serving_pair(folder: Path, url: str) -> Iterator[NodePair]:
    """Both started at the same moment on a fresh database."""
    described = [describe(folder, url, name, port) for name, port in zip("ab", find_ports(2), strict=True)]
    nodes = [RunningNode(settings, start_process(settings)) for settings in described]
    pair = NodePair(*nodes)
    try:
        tokens = [line_with(node.process, r"/set-up/\S+") for node in nodes]
        for node in nodes:
            line_with(node.process, "Sagittal is at")
        assert tokens[0] == tokens[1], "two set-up addresses, of which one is valid"
        person = {"name": "grace", "password": PASSWORD}
        pair.a.client.post(f"/api/v1{tokens[0]}", json=person).raise_for_status()
        pair.b.client.cookies.set("sid", pair.cookie)
        yield pair
    finally:
        for node in pair.both:
            node.client.close()
            node.process.kill()
            node.process.communicate()
