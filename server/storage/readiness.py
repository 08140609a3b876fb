"""Readiness checks for monitoring, which test by writing."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Mapping
from typing import ClassVar

from sqlalchemy.exc import SQLAlchemyError

from sagittal.server.settings import Settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.files.blobs import BlobStore, StoreAway
from sagittal.server.storage.migrate import MigrationError, require_current
from sagittal.server.storage.refusal import Refusal, refusal_of

_WORDS = {
    None: "cannot be written.",
    Refusal.FULL: "cannot be written: the disk is full.",
    Refusal.NOT_WRITABLE: "cannot be written: the disk refuses.",
}
# publicly accessible, so neither message names the bucket; the log does
_AWAY = "The bucket of stored files cannot be reached; see the server's log."
_REFUSES = "The bucket of stored files refuses the server; see its log."


class Readiness:
    """Checks and their latest outcome; repeated at most every EVERY_S, as the route is public.

    Parameters
    ----------
    settings, db, blobs : the installation. clock : monotonic seconds.
    parts : further checks by name, each returns "ok" or a description of the fault.
    """

    EVERY_S: ClassVar[float] = 5.0

    def __init__(
        self,
        settings: Settings,
        db: Database,
        blobs: BlobStore,
        clock: Callable[[], float] = time.monotonic,
        parts: Mapping[str, Callable[[], str]] | None = None,
    ) -> None:
        self._parts = dict(parts or {})
        self._settings, self._db, self._blobs, self._clock = settings, db, blobs, clock
        self._lock = threading.Lock()
        self._checked_at: float | None = None
        self._found: Mapping[str, str] = {}

    def checks(self) -> Mapping[str, str]:
        """Result of each check: "ok", or a sentence about the fault."""
        # a check may wait for a bucket: concurrent callers get the previous result without blocking a thread
        if not self._lock.acquire(blocking=self._checked_at is None):
            return self._found
        try:
            time = self._clock()
            if self._checked_at is None or time - self._checked_at >= self.EVERY_S:
                self._found = self._check()
                self._checked_at = time
            return self._found
        finally:
            self._lock.release()

    def _check(self) -> dict[str, str]:
        settings = self._settings
        checks = {"database": "ok", "files": "ok", "schema": "ok", "disk": "ok"}
        try:
            self._db.probe()
        except SQLAlchemyError as error:
            checks["database"] = f"The database {_WORDS[refusal_of(error)]}"
        try:
            self._blobs.probe()
        except StoreAway as error:
            checks["files"] = _REFUSES if error.refuses else _AWAY
        except OSError as error:
            checks["files"] = f"The data folder {_WORDS[refusal_of(error)]}"
        try:
            require_current(settings.database_source)
        except MigrationError as error:
            checks["schema"] = str(error)
        if shutil.disk_usage(settings.data_dir).free < settings.min_free_bytes:
            checks["disk"] = f"Less than {settings.min_free_bytes} bytes are free; uploads are refused."
        return checks | {name: look() for name, look in self._parts.items()}
