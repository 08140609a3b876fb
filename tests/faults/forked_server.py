"""`sagittal serve` again and again without the seconds of its imports.

Run as a process: it wires the application once and forks for every line on its standard input. Each fork is a
whole server, whose sockets, lock, database and threads are made after the fork; it says on standard output
"at <address>", and this process "pid <number>" of it.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from pathlib import Path

import uvicorn.lifespan.on
import uvicorn.protocols.http.auto
import uvicorn.protocols.websockets.auto  # noqa: F401 - what a server loads when it starts

import server.app
from server.commands.serve import run, say
from server.settings import load_settings
from server.storage.migrate import upgrade


def main() -> None:
    settings = load_settings()
    wired = server.app.create_app(settings)
    server.app.create_app = lambda settings: wired
    with tempfile.TemporaryDirectory() as folder:
        upgrade(Path(folder) / "sagittal.db")  # loads what migrations need
    for _ in sys.stdin:
        child = os.fork()
        if child == 0:
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            say(f"ended {run(settings, lambda address: say(f'at {address}'))}")
            os._exit(0)
        say(f"pid {child}")


if __name__ == "__main__":
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the dead are not waited for
    main()
