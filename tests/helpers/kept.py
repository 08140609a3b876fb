"""What takes long to make, made once: by one process for all, not again while the sources are the same."""

from __future__ import annotations

import contextlib
import copyreg
import fcntl
import functools
import hashlib
import os
import pickle
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import MappingProxyType
from typing import Final, ParamSpec, TypeVar

from tests.data import ROOT

P = ParamSpec("P")
R = TypeVar("R")

SOURCES: Final = ("core", "sagittal", "tests")
"""Folders of which every module counts, and the tables beside them."""
SERVER: Final = ("server", "migrations")
"""Those that count besides for what a server wrote."""
FOLDER: Final = Path(tempfile.gettempdir()) / f"sagittal-tests-{os.getuid()}"
IN_MEMORY: Final = 6
"""Values of a function that stay in a process; the rest are read again, as several share the memory."""
FORGOTTEN_S: Final = 24 * 3600.0
"""What other sources gave is removed after this time."""


def view(content: dict[object, object]) -> MappingProxyType[object, object]:
    """Read-only mapping restored from its pickle."""
    return MappingProxyType(content)


copyreg.pickle(MappingProxyType, lambda seen: (view, (dict(seen),)))


def keep(make: Callable[P, R]) -> Callable[P, R]:
    """Cache a function's results by its arguments, the last in memory and all on disk.

    Parameters
    ----------
    make : deterministic, reads no recordings; its result is picklable and never modified.
    """
    return _keep(make, "")


def keep_recorded(make: Callable[P, R]) -> Callable[P, R]:
    """As `keep`, for results from real recordings, which are part of the key."""
    return _keep(make, os.environ.get("SAGITTAL_DATA", ""))


def keep_served(make: Callable[P, R]) -> Callable[P, R]:
    """As `keep`, for files written by a server, whose sources are part of the key."""
    return _keep(make, hash_sources(SERVER))


def _keep(make: Callable[P, R], depends_on: str) -> Callable[P, R]:
    @functools.lru_cache(IN_MEMORY)
    def kept(*args: P.args, **kwargs: P.kwargs) -> R:
        message = f"{make.__module__}.{make.__qualname__}{args}{sorted(kwargs.items())}{depends_on}"
        path = folder() / hashlib.sha256(message.encode()).hexdigest()[:32]
        with locked(path.with_suffix(".lock")):
            if not path.exists():
                recording = make(*args, **kwargs)
                part = path.with_suffix(".part")
                part.write_bytes(pickle.dumps(recording, pickle.HIGHEST_PROTOCOL))
                part.rename(path)
                return recording
        result: R = pickle.loads(path.read_bytes())  # noqa: S301  written by this user's tests
        return result

    return functools.wraps(make)(kept)  # type: ignore[return-value]


@functools.cache
def folder() -> Path:
    """Cache folder of the current sources; created on demand, outdated ones are removed."""
    FOLDER.mkdir(mode=0o700, exist_ok=True)
    if FOLDER.stat().st_uid != os.getuid():
        raise PermissionError(f"{FOLDER} belongs to somebody else; set TMPDIR to a folder of your own")
    for other_path in FOLDER.iterdir():
        if time.time() - other_path.stat().st_mtime > FORGOTTEN_S:
            shutil.rmtree(other_path, ignore_errors=True)
    mine = FOLDER / hash_sources(SOURCES)
    mine.mkdir(exist_ok=True)
    return mine


@functools.cache
def hash_sources(folders: tuple[str, ...]) -> str:
    """16 hexadecimal digits that change with every source in these folders."""
    digest = hashlib.sha256()
    for name in folders:
        for path in sorted((ROOT / name).rglob("*")):
            if path.suffix in (".py", ".csv", ".json"):
                digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Be the only process in the block of this path."""
    with path.open("w") as f:
        fcntl.flock(f, fcntl.LOCK_EX)
        yield
