"""Environment inherited by child processes."""

from __future__ import annotations

import os
from pathlib import Path

import sagittal
from sagittal.server.settings import Settings
from sagittal.server.storage.compile_cache import share_compile_cache

ONE_THREAD = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
"""One job uses one core: reproducible numbers, and the web process keeps the other."""


def make_environment(settings: Settings) -> dict[str, str]:
    """Return the environment of a child process: settings, path to our code, one thread, kernel cache."""
    root = str(Path(sagittal.__file__).parent.parent)
    path = os.pathsep.join(p for p in (root, os.environ.get("PYTHONPATH")) if p)
    share_compile_cache(settings.cache)
    return {**os.environ, **settings.environment(), **ONE_THREAD, "PYTHONPATH": path}
