"""Writes the estimator's events (cues, calibrations, notices) to the database, grouped once a second.

One thread for all trials: transactions wait for the disk, which must not delay streams.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping
from typing import Any, Final

from sqlalchemy import insert, select
from sqlalchemy.exc import SQLAlchemyError

from sagittal.core.feedback import Cue
from sagittal.server.live_takes.live_training import note_feedback
from sagittal.server.storage.db import Database
from sagittal.server.storage.disk_log import DiskLog
from sagittal.server.storage.schema.live_tables import live_event, live_take
from sagittal.server.storage.schema.tables import now

log = logging.getLogger(__name__)

INTERVAL_S: Final = 0.5
"""Rows wait this long for others; including the transaction they are written within a second."""


class Journal:
    """Thread and queue of rows for the table `live_event`."""

    def __init__(self, db: Database, interval_s: float = INTERVAL_S) -> None:
        self._db = db
        self._interval_s = interval_s
        self._disk = DiskLog(log)
        self._rows: list[dict[str, Any]] = []
        self._guard = threading.Lock()
        self._work = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live-journal", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Write queued rows and end."""
        self._stop.set()
        self._work.set()
        if self._thread.is_alive():
            self._thread.join()
        self.write()

    def add(self, take_id: str, kind: str, t_s: float | None, content: Mapping[str, Any]) -> None:
        """Queue a row; returns immediately."""
        row = {"take_id": take_id, "kind": kind, "t_s": t_s, "content": dict(content), "at": now()}
        with self._guard:
            self._rows.append(row)
        self._work.set()

    def write(self) -> None:
        """Write all rows in one transaction, except those of erased trials."""
        with self._guard:
            rows, self._rows = self._rows, []
        if not rows:
            return
        try:
            with self._db.write() as c:
                ids = {row["take_id"] for row in rows}
                existing = set(c.execute(select(live_take.c.id).where(live_take.c.id.in_(ids))).scalars())
                valid = [row for row in rows if row["take_id"] in existing]
                if valid:
                    c.execute(insert(live_event), valid)
                    note_feedback(c, {row["take_id"] for row in valid if _told(row)})
        except SQLAlchemyError as error:
            self._disk.note_refusal(error, "live events")
            with self._guard:
                self._rows = rows + self._rows
            self._work.set()
        else:
            self._disk.note_success()

    def _run(self) -> None:
        while not self._stop.is_set():
            self._work.wait()
            self._stop.wait(self._interval_s)
            self._work.clear()
            self.write()


def _told(row: Mapping[str, Any]) -> bool:
    return row["kind"] == "cue" and Cue.from_json(row["content"]).with_feedback
