"""One log line when writing to disk fails, and one when it works again.

disk = DiskLog(log)
disk.note_refusal(error, "the live logs")      # for every failed write; other errors are logged in full
disk.note_success()                            # for every successful write
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Final

from sagittal.server.storage.refusal import refusal_of

QUIET_S: Final = 60.0
"""Minimum interval of reports about an intermittently full disk."""


class DiskLog:
    """Reports disk failures for one kind of writes.

    Parameters
    ----------
    logger : receives the lines. clock : seconds.
    """

    def __init__(self, logger: logging.Logger, clock: Callable[[], float] = time.monotonic) -> None:
        self._log, self._clock = logger, clock
        self._guard = threading.Lock()
        self._since: float | None = None
        self._quiet_until: float | None = None

    def note_refusal(self, error: BaseException, description: str) -> None:
        """Report a failed write, once until writes succeed; other errors are logged with a traceback.

        Parameters
        ----------
        description : description of the written object, for the log.
        """
        refusal = refusal_of(error)
        reason = refusal.value if refusal is not None else getattr(error, "strerror", None)
        if reason is None:
            self._log.error("%s cannot be written", description, exc_info=error)
            return
        with self._guard:
            time = self._clock()
            if self._since is not None or (self._quiet_until is not None and time < self._quiet_until):
                return
            self._since, self._quiet_until = time, time + QUIET_S
        self._log.error("%s cannot be written (%s); not repeated until writes succeed", description, reason)

    def note_success(self) -> None:
        """Report that writes succeed again, if a failure was reported."""
        if self._since is None:
            return
        with self._guard:
            since, self._since = self._since, None
        if since is not None:
            self._log.warning("writes succeed again, after %.0f s", self._clock() - since)
