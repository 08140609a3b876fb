"""`sagittal demo`: a temporary clinic with simulated patients; nothing is stored permanently."""

from __future__ import annotations

import secrets
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import closing
from pathlib import Path

from sqlalchemy import func, select

from sagittal.server.commands.options import Whole
from sagittal.server.commands.serve import run, say
from sagittal.server.processes.compiling import is_compiling
from sagittal.server.settings import load_settings
from sagittal.server.storage.compile_cache import has_compiled_filters
from sagittal.server.storage.db import Database, Source

DEMO_WORKERS = 2


def demo(*, port: Whole | None = None) -> int:
    """Serve a clinic of simulated patients on 127.0.0.1 until Ctrl-C, then delete its folder.

    Parameters
    ----------
    port
        port on 127.0.0.1 (default: a free one)
    """
    from sagittal.server.auth import accounts, one_time
    from sagittal.server.auth.passwords import hash_password
    from sagittal.server.auth.roles import Role
    from sagittal.server.processes.environment import make_environment

    with tempfile.TemporaryDirectory(prefix="sagittal-demo-") as folder:
        settings = load_settings(
            {
                "data_dir": Path(folder),
                "host": "127.0.0.1",
                "port": port or 0,
                "workers": DEMO_WORKERS,
                "behind_tls": False,
                "allowed_hosts": (),
                "node_name": "",
                "node_address": "",
                "database_url": "",  # nor may they be added to its patients
                "bucket": "",
                "backup_dir": "",  # simulated backups must not displace the clinic's own
            }
        )
        helpers: list[subprocess.Popen[bytes]] = []

        def start(*module: str) -> None:
            command = [sys.executable, "-m", *module]
            helpers.append(subprocess.Popen(command, env=make_environment(settings)))  # noqa: S603 - our own

        def announce(address: str) -> None:
            with closing(Database(settings.database_source)) as db, db.write() as c:
                person = accounts.create(
                    c, "demo", "Demo", Role.ADMIN, hash_password(secrets.token_urlsafe(24))
                )
                token = one_time.issue_sign_in(c, person.id)
            say(f"Open {address}/sign-in/{token}")
            say("(signs you in once; everything is simulated and is removed when you stop with Ctrl-C)")
            # simulating takes seconds of CPU time: never in the web process
            start("sagittal.server.demo.clinic")
            _report(settings.database_source)
            start("sagittal.server.demo.live", address)
            if _wait_for_live(settings.database_source, helpers[-1]):
                say("One of the patients is walking live now: the first in the list of patients.")

        try:
            return run(settings, announce)
        finally:
            for process in helpers:
                process.terminate()
                process.wait()


def _wait_for_live(database: Source, helper: subprocess.Popen[bytes]) -> bool:
    """Wait until a simulated walk is streaming; False if its process ended first."""
    from sagittal.server.live_takes import live

    pause = threading.Event()
    with closing(Database(database)) as db:
        while helper.poll() is None:
            with db.read() as c:
                if any(take.state == "streaming" for take in live.list_running(c)):
                    return True
            pause.wait(0.2)
    return False


def _report(database: Source) -> None:
    """Print progress to the console until every session is analysed."""
    from sagittal.server.demo.clinic import VISITS
    from sagittal.server.storage.schema.tables import job
    from sagittal.server.uploads.recordings import ANALYSE

    began, last_text = time.monotonic(), ""
    if is_compiling() or not has_compiled_filters():
        say("Compiling the filters (once for you and this version, up to a minute) …")
    pause = threading.Event()
    with closing(Database(database)) as db:
        while True:
            with db.read() as c:
                ended = c.execute(
                    select(func.count())
                    .select_from(job)
                    .where(job.c.kind == ANALYSE, job.c.finished_at.is_not(None))
                ).scalar_one()
            text = f"{ended} of {len(VISITS)} sessions analysed ({time.monotonic() - began:.0f} s)"
            if ended and text.split(" (")[0] != last_text:
                last_text = text.split(" (")[0]
                say(text)
            if ended >= len(VISITS):
                return
            pause.wait(0.5)
