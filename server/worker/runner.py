"""The worker's hold on its child: start it, give it an order, listen, kill it."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from multiprocessing.connection import Connection

from server.processes.environment import make_environment
from server.settings import Settings
from server.worker.messages import Order, Reply, decode_reply, encode


class ChildDiedError(Exception):
    """The child is gone without an answer."""


class Child:
    """A running child process; it is warm once it has said Ready."""

    def __init__(self, settings: Settings) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                [sys.executable, "-m", "server.worker.child", str(theirs.fileno()), str(os.getpid())],
                env=make_environment(settings),
                stdin=subprocess.PIPE,
                pass_fds=[theirs.fileno()],
            )
        self._line = Connection(ours.detach())

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def send(self, order: Order) -> None:
        """Give it work; raises ChildDiedError."""
        try:
            self._line.send_bytes(encode(order))
        except OSError:
            raise self._death() from None

    def receive(self, timeout_s: float) -> Reply | None:
        """Return its next word, None if it says nothing in time; raises ChildDiedError."""
        try:
            return decode_reply(self._line.recv_bytes()) if self._line.poll(timeout_s) else None
        except (EOFError, OSError):
            raise self._death() from None

    def kill(self) -> None:
        """End it now and wait until it is gone."""
        self._process.kill()
        self._process.wait()
        if self._process.stdin:
            self._process.stdin.close()
        self._line.close()

    def _death(self) -> ChildDiedError:
        self.kill()
        return ChildDiedError(f"computing process {self.pid} ended with status {self._process.returncode}")
