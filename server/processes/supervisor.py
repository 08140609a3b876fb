"""Supervisor of the worker processes of `sagittal serve`: starts, restarts and stops them.

workers = Workers(settings); workers.start(); ...; workers.stop()
"""

from __future__ import annotations

import contextlib
import logging
import subprocess
import threading
import time

from sagittal.server.processes.child import BEHIND, end_process, start_module
from sagittal.server.settings import Settings

log = logging.getLogger(__name__)

LOOK_S = 0.2
"""Interval of checks that all workers are running."""
RESTART_S = 1.0
"""Minimum interval of restarts of a worker."""
GRACE_S = 5.0
"""Time limit for a worker to release its job before it is killed."""


class Workers:
    """Worker processes, `settings.workers` in number."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._stop = threading.Event()
        self._processes: list[subprocess.Popen[bytes]] = []
        self._thread = threading.Thread(target=self._watch, name="workers", daemon=True)

    def start(self) -> None:
        """Start all workers without waiting until they are warm."""
        self._processes = [self._spawn() for _ in range(self._settings.workers)]
        self._thread.start()

    def stop(self) -> None:
        """Let each worker return its job to the queue, and wait until all have ended."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        for process in self._processes:
            process.terminate()
        limit = time.monotonic() + GRACE_S
        for process in self._processes:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(max(limit - time.monotonic(), 0.1))
            end_process(process)

    @property
    def pids(self) -> list[int]:
        """Process ids of the running workers."""
        return [p.pid for p in self._processes if p.poll() is None]

    @property
    def healthy(self) -> bool:
        """Whether all workers are running."""
        return len(self.pids) == self._settings.workers

    def _spawn(self) -> subprocess.Popen[bytes]:
        return start_module("sagittal.server.worker.worker", self._settings, BEHIND)

    def _watch(self) -> None:
        began = time.monotonic()
        while not self._stop.wait(LOOK_S):
            for i, process in enumerate(self._processes):
                if process.poll() is None:
                    continue
                log.warning(
                    "worker %d ended with status %d; starting another", process.pid, process.returncode
                )
                end_process(process)
                self._stop.wait(max(0.0, began + RESTART_S - time.monotonic()))
                began = time.monotonic()
                self._processes[i] = self._spawn()
