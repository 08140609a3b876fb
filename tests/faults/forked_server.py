"""Run `sagittal serve` repeatedly without repeating its imports.

The process wires the application once and forks for each line of standard input, a JSON object of environment
variables. Each fork is a complete server whose sockets, lock, database and threads are created after the
fork; it prints "at <address>", the parent "pid <number>".
"""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
from pathlib import Path

import psycopg_pool  # noqa: F401
import uvicorn.lifespan.on
import uvicorn.protocols.http.auto
import uvicorn.protocols.websockets.auto  # noqa: F401 - what a server loads when it starts
from fastapi import FastAPI

from sagittal.server import app
from sagittal.server.commands.serve import run, say
from sagittal.server.processes.lifeline import die_with
from sagittal.server.settings import Settings, load_settings
from sagittal.server.storage.migrate import upgrade


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        wired = app.create_app(Settings(data_dir=Path(folder)))
        upgrade(Path(folder) / "sagittal.db")  # loads what migrations need
    forker = os.getpid()
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            serve(wired, json.loads(line), forker)
        say(f"pid {child}")


def serve(wired: FastAPI, environment: dict[str, str], forker: int) -> None:
    """Be a server until it ends."""
    die_with(forker)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.environ.update(environment)
    wired.state.settings = settings = load_settings()
    app.create_app = lambda settings: wired
    try:
        if code := run(settings, lambda address: say(f"at {address}")):
            say(f"ended {code}")
    finally:
        os._exit(0)


if __name__ == "__main__":
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the dead are not waited for
    main()
