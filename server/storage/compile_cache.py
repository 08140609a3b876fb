"""Shared folder of compiled filters per user, installation and version.

numba compiles a filter at its first call, up to a minute for all of them, and later loads it from this
folder, which is shared by command line, web server, workers, live estimators, demo and tests.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from sagittal import core

VARIABLE: Final = "NUMBA_CACHE_DIR"
"""Environment variable read by numba at import."""
KEEP_S: Final = 60 * 24 * 3600.0
"""Folders of other versions unused for this long are removed."""

_IMPORTED = re.compile(
    r"^\s*(?:from|import)\s+(sagittal\.core(?:\.\w+)*)(?:\s+import\s+(?:\(([\w,\s]+)\)|([\w, ]+)))?",
    re.MULTILINE,
)


def share_compile_cache(fallback: Path) -> Path:
    """Select the folder for this process and its children; call before numba is imported.

    Parameters
    ----------
    fallback : folder used if the user's cache folder is not writable (created if needed).

    Returns
    -------
    The folder, now set as `NUMBA_CACHE_DIR` of this process unless the variable was already set.
    """
    configured = os.environ.get(VARIABLE)
    folder = Path(configured) if configured else find_compile_cache(os.environ, fallback)
    os.environ[VARIABLE] = str(folder)
    return folder


def has_compiled_filters() -> bool:
    """Whether the folder of this process already contains filters, so that startup need not wait for them."""
    return any(Path(os.environ[VARIABLE]).rglob("*.nbi"))


def find_compile_cache(environment: Mapping[str, str], fallback: Path) -> Path:
    """Return the user's folder for this installation's filters, created if necessary; otherwise `fallback`.

    Parameters
    ----------
    environment : `XDG_CACHE_HOME` and `HOME` are read from it.
    fallback : folder used if the user's cache folder has another owner or is not writable.
    """
    version = _name_installation(Path(core.__file__ or "").parent)
    home = environment.get("XDG_CACHE_HOME") or os.path.join(environment.get("HOME", "/"), ".cache")  # noqa: PTH118
    folder = Path(home) / "sagittal" / f"filters-{version}"
    if not (Path(home).is_absolute() and _is_ours(folder)):
        return fallback / f"filters-{version}"
    _remove_old_versions(folder)
    return folder


def _name_installation(package: Path) -> str:
    """Return the fingerprint of the filters and their location.

    numba identifies a compiled filter by the path of its source. If several installations of a version shared
    a folder, filters of another would appear to be present: startup would not announce the wait, and each
    process would compile on its own, one filter after another.
    """
    place = hashlib.sha256(os.fsencode(package.resolve())).hexdigest()[:4]
    return f"{fingerprint_filters(package)}-{place}"


def fingerprint_filters(package: Path) -> str:
    """Return 12 hexadecimal digits that change with any source of a compiled filter.

    numba checks the modification time of one file only, although a filter is compiled together with functions
    and constants of other modules; so all modules reachable from a module with a filter are included.

    Parameters
    ----------
    package : folder of the package `sagittal.core`.
    """
    sources = {
        ".".join(("sagittal", "core", *_parts(p, package))): p.read_bytes() for p in package.rglob("*.py")
    }
    waiting = [name for name, text in sources.items() if b"njit" in text]
    reached: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name not in reached and name in sources:
            reached.add(name)
            waiting.extend(_imports(sources[name].decode()))
    digest = hashlib.sha256()
    for name in sorted(reached):
        digest.update(name.encode() + b"\0" + sources[name] + b"\0")
    return digest.hexdigest()[:12]


def _parts(path: Path, package: Path) -> tuple[str, ...]:
    parts = path.relative_to(package).with_suffix("").parts
    return parts[:-1] if parts[-1] == "__init__" else parts


def _imports(source: str) -> Iterator[str]:
    """Names that may be modules of core: the module after `from` and the names imported from it."""
    for module, lines, line in _IMPORTED.findall(source):
        yield module
        yield from (f"{module}.{name.strip()}" for name in (lines or line).split(","))


def _is_ours(folder: Path) -> bool:
    """Create the folder; return whether it exists, belongs to this user and is writable."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        # a folder of another user may contain foreign machine code
        if folder.stat().st_uid != os.getuid() or not os.access(folder, os.W_OK | os.X_OK):
            return False
        os.utime(folder)
    except OSError:
        return False
    return True


def _remove_old_versions(folder: Path) -> None:
    limit = time.time() - KEEP_S
    with suppress(OSError):
        for old_folder in folder.parent.glob("filters-*"):
            if old_folder != folder and old_folder.stat().st_mtime < limit:
                shutil.rmtree(old_folder, ignore_errors=True)
