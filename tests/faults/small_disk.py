"""A real file system of a few megabytes, to be filled to its last byte."""

from __future__ import annotations

import contextlib
import errno
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers.postgres import give_to_server, run_sql


def run(*command: str) -> None:
    """Mount or unmount; skips the test where this user may not."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"a file system of a given size cannot be mounted here ({done.stderr.strip()})")


@contextlib.contextmanager
def mounted(folder: Path, megabytes: int) -> Iterator[Path]:
    """A file system of this size on the folder `disk`."""
    folder.mkdir()
    run("mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", str(folder))
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=False)


@contextlib.contextmanager
def on_small_disk(database: str, megabytes: int) -> Iterator[Path]:
    """The tables of a database of PostgreSQL on a file system of this size while the block runs."""
    # where PostgreSQL's own user may go, who moves only what nobody uses
    room = Path(tempfile.mkdtemp(prefix="sagittal-disk-"))
    room.chmod(0o755)
    try:
        with mounted(room / "disk", megabytes) as disk:
            (disk / "tables").mkdir()
            give_to_server(disk / "tables")
            run_sql(f"CREATE TABLESPACE small LOCATION '{disk / 'tables'}'")
            try:
                _move(database, "small")
                yield disk
            finally:
                _move(database, "pg_default")
                run_sql("DROP TABLESPACE small")
    finally:
        shutil.rmtree(room)


def _move(database: str, tablespace: str) -> None:
    run_sql(f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '{database}'")  # noqa: S608
    run_sql(f"ALTER DATABASE {database} SET TABLESPACE {tablespace}")


@contextlib.contextmanager
def full(folder: Path) -> Iterator[None]:
    """Not one byte of room while the block runs."""
    ballast = folder / "ballast"
    with ballast.open("wb", buffering=0) as file:
        for size in (1 << 20, 1 << 12, 1):
            try:
                while file.write(bytes(size)) == size:
                    pass
            except OSError as error:
                if error.errno != errno.ENOSPC:
                    raise
    try:
        yield
    finally:
        ballast.unlink()
