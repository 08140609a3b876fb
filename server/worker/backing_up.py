"""Scheduled backups next to the running server: a thread with a timer and a separate process for each backup.

The process serves neither web requests nor jobs, and runs at low disk and CPU priority (nice).
"""

from __future__ import annotations

import datetime as dt
import logging
import os
import subprocess
import threading
from contextlib import closing
from pathlib import Path
from typing import Final

from sqlalchemy.exc import SQLAlchemyError

from sagittal.server.log import start_log
from sagittal.server.processes.child import FAR_BEHIND, end_process, start_module
from sagittal.server.processes.lifeline import call_when_parent_ends
from sagittal.server.safekeeping import backup_schedule
from sagittal.server.safekeeping.tombstones import TombstoneError, find_tombstones, keep_tombstones
from sagittal.server.settings import Settings, load_settings
from sagittal.server.storage.db import Database

MODULE: Final = "sagittal.server.worker.backing_up"
log = logging.getLogger(MODULE)

BACKUP: Final = "backup"
"""Task of making a backup, which one web server runs at a time."""
LOOK_S: Final = 20.0
"""Interval of checking the time and recent erasures."""


class BackupKeeper:
    """Thread of `sagittal serve` that schedules backups; idle if no folder is configured."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="backups", daemon=True)
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the thread."""
        if self._settings.backup_dir:
            self._thread.start()

    def stop(self) -> None:
        """End the thread; a backup in progress is abandoned."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout=LOOK_S)

    def _run(self) -> None:
        db = Database(self._settings.database_source)
        try:
            while not self._stop.wait(LOOK_S):
                self._look(db)
        finally:
            if self._process is not None:
                end_process(self._process)
            db.close()

    def _look(self, db: Database) -> None:
        if self._process is not None and self._process.poll() is not None:
            end_process(self._process)
            self._process = None
        try:
            with db.do_alone("tombstones") as is_mine:
                if is_mine and Path(self._settings.backup_dir).is_dir():
                    with db.read() as c:
                        erased = find_tombstones(c)
                    keep_tombstones(erased, Path(self._settings.backup_dir))
        except (OSError, SQLAlchemyError, TombstoneError):
            log.exception("who has been erased could not be written beside the backups; trying again")
        try:
            if self._process is None and _is_due(self._settings):
                with db.do_alone(BACKUP) as is_mine:
                    is_free = is_mine
                if is_free:
                    self._process = start_module(MODULE, self._settings, FAR_BEHIND)
        except SQLAlchemyError:
            log.exception("the database is away; trying again")


def main() -> None:
    """Make one backup, and test it if due."""
    call_when_parent_ends(lambda: os._exit(1))
    settings = load_settings()
    start_log(settings)
    with closing(Database(settings.database_source)) as db, db.do_alone(BACKUP) as is_mine:
        # another web server may have been faster
        if not is_mine or not _is_due(settings):
            return
        state = backup_schedule.run(settings)
    if state.backup is not None and state.backup.ok:
        log.info("backup %s, %d bytes", state.backup.name, state.backup.size)


def _is_due(settings: Settings) -> bool:
    return backup_schedule.is_due(settings, dt.datetime.now().astimezone())


if __name__ == "__main__":
    main()
