"""`sagittal serve`: the web server and its workers on one data folder."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from server.settings import Settings, load_settings


def serve(data_dir: Path | None, host: str | None, port: int | None, workers: int | None) -> int:
    """Serve until SIGTERM or Ctrl-C; 1 when the folder is in use or belongs to a newer version."""
    from server.auth import one_time
    from server.storage.db import Database

    settings = load_settings({"data_dir": data_dir, "host": host, "port": port, "workers": workers})

    def announce(address: str) -> None:
        with closing(Database(settings.database_source)) as db, db.write() as c:
            token = one_time.issue_set_up(c) if one_time.needs_set_up(c) else None
        if token:
            say(f"First start: set up the first administrator at {address}/set-up/{token}")
        say(f"Sagittal is at {address} (data in {settings.data_dir})")

    return run(settings, announce)


def run(settings: Settings, announce: Callable[[str], None]) -> int:
    """Run web server and workers; `announce` gets the address once requests are answered."""
    from server.app import create_app
    from server.log import start_log
    from server.processes.supervisor import Workers
    from server.services.custody import StrangersError, refuse_strangers
    from server.storage import fs
    from server.storage.db import Database
    from server.storage.migrate import MigrationError, upgrade
    from server.web_server.build import build_server
    from server.web_server.connection import ConnectionLimits
    from server.web_server.listener import make_room, open_listener
    from server.worker.backing_up import BackupKeeper

    start_log(settings)
    # what SQLite and libraries make is for the server's user only, as what we make is
    os.umask(0o077)
    fs.make_folder(settings.data_dir)
    try:
        lock = fs.Lock(settings.lock, f"process {os.getpid()}")
    except fs.LockedError as error:
        sys.stderr.write(
            f"Another server ({error.holder}) is running on {settings.data_dir}; stop it first.\n"
        )
        return 1
    served = contextlib.ExitStack()
    try:
        refuse_strangers(settings)
        upgrade(settings.database_source, backups=settings.backups)
        db = served.enter_context(closing(Database(settings.database_source)))
        if not served.enter_context(db.serve_alone()):
            raise StrangersError(
                "Another server is running on this PostgreSQL database; stop it first. To share its work, "
                "start `sagittal worker` here instead."
            )
        listener = open_listener(settings.host, settings.port)
    except (StrangersError, MigrationError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        served.close()
        lock.release()
        return 1
    workers, keeper = Workers(settings), BackupKeeper(settings)
    app = create_app(settings)
    app.state.workers = workers
    limits = ConnectionLimits(most=make_room(settings.max_connections))
    server = build_server(app, settings, limits)
    host = f"[{settings.host}]" if ":" in settings.host else settings.host
    address = f"http://{host}:{listener.getsockname()[1]}"
    threading.Thread(target=_when_started, args=(server, lambda: announce(address)), daemon=True).start()
    # uvicorn stops gracefully and then raises the signal again: without a handler that would end us here,
    # before the workers have given their jobs back
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: None)
    try:
        workers.start()
        keeper.start()
        server.run(sockets=[listener])
    finally:
        keeper.stop()
        workers.stop()
        listener.close()
        served.close()
        lock.release()
    return 0 if server.started else 1


def say(text: str) -> None:
    """Print one line at once, also into a pipe."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def _when_started(server: object, then: Callable[[], None]) -> None:
    """Call `then` once the server answers."""
    pause = threading.Event()
    while not getattr(server, "started", False):
        if getattr(server, "should_exit", False):
            return
        pause.wait(0.05)
    then()
