"""Empty databases for tests: one is migrated by each process, all others are copies of it."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

from sagittal.server.storage import fs
from sagittal.server.storage.migrate import upgrade


@functools.cache
def _migrate_one() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sagittal.db"
        upgrade(path)
        return path.read_bytes()


def write_database(path: Path) -> None:
    """Write what `upgrade` makes where there is none, which takes it a seventh of a second."""
    fs.make_folder(path.parent)
    path.touch()
    fs.keep_private(path)
    path.write_bytes(_migrate_one())
