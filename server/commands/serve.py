"""`sagittal serve`: the web server and its workers on one data folder."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import closing
from typing import TYPE_CHECKING

from sagittal.server.commands.options import DataDir, Whole
from sagittal.server.settings import Settings, SettingsError, load_settings

if TYPE_CHECKING:
    from sagittal.server.web_server.listener import ListeningSocket


def serve(
    *,
    host: str | None = None,
    port: Whole | None = None,
    workers: Whole | None = None,
    data_dir: DataDir = None,
) -> int:
    """Serve until SIGTERM or Ctrl-C; 1 if the folder is in use or belongs to a newer version.

    Parameters
    ----------
    host
        address to listen on (default 127.0.0.1)
    port
        port to listen on (default 8000)
    workers
        worker processes (default 1)
    """
    from sagittal.server.auth import one_time
    from sagittal.server.nodes.passage import read_key
    from sagittal.server.storage.db import Database

    settings = load_settings({"data_dir": data_dir, "host": host, "port": port, "workers": workers})

    def announce(address: str) -> None:
        shared_key = read_key(settings.node_key) if settings.node_name else b""
        with closing(Database(settings.database_source)) as db, db.write() as c:
            token = one_time.issue_set_up(c, shared_key) if one_time.needs_set_up(c) else None
        if token:
            say(f"First start: set up the first administrator at {address}/set-up/{token}")
        say(f"Sagittal is at {address} (data in {settings.data_dir})")

    return run(settings, announce)


def run(settings: Settings, announce: Callable[[str], None]) -> int:
    """Run web server and workers; `announce` receives the public address once requests are answered.

    Raises
    ------
    SettingsError
        the server would listen on a network without TLS.
    """
    from sagittal.core.errors import SagittalError
    from sagittal.server.app import create_app
    from sagittal.server.log import start_log
    from sagittal.server.processes.supervisor import Workers
    from sagittal.server.safekeeping.custody import StrangersError
    from sagittal.server.storage import fs
    from sagittal.server.storage.migrate import MigrationError
    from sagittal.server.web_server.build import build_server
    from sagittal.server.web_server.connection import ConnectionLimits
    from sagittal.server.web_server.listener import make_room
    from sagittal.server.worker.backing_up import BackupKeeper

    settings.require_private_traffic()
    start_log(settings)
    # files created by SQLite and libraries must be accessible to the server's user only, like our own
    os.umask(0o077)
    served = contextlib.ExitStack()
    try:
        listener = _take_folder(settings, served)
    except fs.LockedError as error:
        served.close()
        sys.stderr.write(f"Another server ({error.holder}) is running on {error.folder}; stop it first.\n")
        return 1
    except (StrangersError, MigrationError, SettingsError, SagittalError, OSError) as error:
        served.close()
        if isinstance(error, OSError) and error.filename is not None:
            raise  # reported with the setting to check, as in every command
        sys.stderr.write(f"{error}\n")
        return 1
    workers, keeper = Workers(settings), BackupKeeper(settings)
    app = create_app(settings)
    app.state.workers = workers
    limits = ConnectionLimits(most=make_room(settings.max_connections))
    server = build_server(app, settings, limits)
    address = settings.make_public_address(listener.getsockname()[1])
    threading.Thread(target=_when_started, args=(server, lambda: announce(address)), daemon=True).start()
    _ignore_stop_signals()
    try:
        workers.start()
        keeper.start()
        server.run(sockets=[listener])
    finally:
        keeper.stop()
        workers.stop()
        served.close()
    return 0 if server.started else 1


def _take_folder(settings: Settings, served: contextlib.ExitStack) -> ListeningSocket:
    """Lock the data folder, listen and upgrade the database; open resources are added to `served`."""
    from sagittal.server.nodes.registry import Nodes
    from sagittal.server.safekeeping.custody import (
        StrangersError,
        refuse_half_restored,
        refuse_strangers,
        refuse_wrong_clock,
    )
    from sagittal.server.storage import fs
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.files.blob_opening import (
        note_bucket,
        open_blobs,
        require_use,
        warn_of_leftovers,
    )
    from sagittal.server.storage.migrate import read_revision, upgrade
    from sagittal.server.web_server.listener import open_listener

    holder = f"process {os.getpid()}"
    fs.make_folder(settings.data_dir)
    served.enter_context(fs.Lock(settings.lock, holder, shared=bool(settings.node_name)))
    # before creating anything in a folder that must be empty for `sagittal restore`
    refuse_half_restored(settings)
    if settings.node_name:
        fs.make_folder(settings.node_folder)
        served.enter_context(fs.Lock(settings.node_lock, holder))
    let_in = require_use(open_blobs(settings))
    refuse_strangers(settings)
    read_revision(settings.database_source)  # explains why PostgreSQL cannot be reached
    if settings.node_name:
        with closing(Database(settings.database_source)) as db:
            refuse_wrong_clock(db, settings)
    # last, so that a rejected start changes nothing
    listener = served.enter_context(open_listener(settings.host, settings.port))
    if let_in:
        note_bucket(settings)
    warn_of_leftovers(settings)
    upgrade(settings.database_source, backups=settings.backups)
    db = served.enter_context(closing(Database(settings.database_source)))
    if not served.enter_context(db.serve(settings.node_name)):
        raise StrangersError(_explain_other(settings))
    if settings.node_name:
        Nodes(settings, db, lambda: None).refuse_strangers()
    return listener


def _ignore_stop_signals() -> None:
    # uvicorn stops gracefully and then raises the signal again: without a handler that would end the process
    # before the workers have released their jobs
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: None)


def _explain_other(settings: Settings) -> str:
    if settings.node_name:
        return (
            f"A server named '{settings.node_name}', or one without a name, is running on this PostgreSQL "
            "database. Stop it first, or give this one another SAGITTAL_NODE_NAME."
        )
    return (
        "Another server is running on this PostgreSQL database; stop it first. To share its work, start "
        "`sagittal worker` here instead, or give every server a SAGITTAL_NODE_NAME."
    )


def say(text: str) -> None:
    """Print one line and flush."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def _when_started(server: object, callback: Callable[[], None]) -> None:
    """Call `then` once the server responds."""
    pause = threading.Event()
    while not getattr(server, "started", False):
        if getattr(server, "should_exit", False):
            return
        pause.wait(0.05)
    callback()
