"""Servers that start within a tenth of a second, forked from a process with all imports loaded."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from sagittal.server.processes.environment import make_environment
from sagittal.server.settings import Settings
from tests.data import ROOT
from tests.faults.clinic import state_of, until


class Forker:
    """The process that forks (tests/faults/forked_server.py); end it with `end`."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.faults.forked_server"],
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def start(self, settings: Settings) -> ForkedServer:
        """Start a server and wait until it answers."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(make_environment(settings)) + "\n")
        self._process.stdin.flush()
        mapping = dict((self._word(), self._word()))
        return ForkedServer(int(mapping["pid"]), mapping["at"])

    def end(self) -> None:
        """Start no more."""
        self._process.kill()
        self._process.communicate()

    def _word(self) -> tuple[str, str]:
        assert self._process.stdout is not None
        kind, _, remainder = self._process.stdout.readline().strip().partition(" ")
        assert kind in {"pid", "at"}, f"the server did not start: {kind} {remainder}"
        return kind, remainder


class ForkedServer:
    """Running forked server; its end is detected by process id, as only the forker is its parent."""

    def __init__(self, pid: int, address: str) -> None:
        self.pid, self.address = pid, address

    def freeze(self) -> None:
        """Let it take and answer nothing more."""
        os.kill(self.pid, signal.SIGSTOP)
        until(lambda: state_of(self.pid) == "T")

    def kill(self) -> None:
        """End it without a word, if it has not ended."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)
        self.wait()

    def wait(self, patience_s: float = 60.0) -> None:
        """Wait until it is gone altogether: a zombie may have a thread in a sync, which holds the lock."""
        until(lambda: not Path(f"/proc/{self.pid}").exists(), patience_s)

    @contextmanager
    def running(self) -> Iterator[ForkedServer]:
        """Kill it at the block's end, whatever became of it."""
        try:
            yield self
        finally:
            self.kill()
