"""Databases for tests that run on both engines; a room's conftest imports these fixtures."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from server.storage.db import Source
from tests.databases import write_database
from tests.marks import ON_POSTGRES
from tests.postgres import NoPostgresError, make_database, make_lasting_database, start_server

ENGINES: Final = ("sqlite", pytest.param("postgresql", marks=pytest.mark.postgres))

_lasting: dict[Path, str] = {}


def choose_url(folder: Path) -> str:
    """The `database_url` of a clinic on this folder: "" = a file in it; the same for who opens it again.

    Skips the test where PostgreSQL is wanted and is not there.
    """
    if not ON_POSTGRES:
        return ""
    if folder not in _lasting:
        try:
            _lasting[folder] = make_lasting_database()
        except NoPostgresError as error:
            pytest.skip(str(error))
    return _lasting[folder]


@pytest.fixture(params=ENGINES)
def source(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Source]:
    """A database with the tables of this version and no row: once a file, once PostgreSQL where it is."""
    if request.param == "sqlite":
        write_database(tmp_path / "sagittal.db")
        yield tmp_path / "sagittal.db"
    else:
        with require_postgres() as url:
            yield url


@pytest.fixture(params=ENGINES)
def bare_source(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Source]:
    """Where a database can be made, on both engines."""
    if request.param == "sqlite":
        yield tmp_path / "sagittal.db"
    else:
        with require_postgres(migrated=False) as url:
            yield url


@pytest.fixture
def postgres() -> Iterator[str]:
    """A migrated database of PostgreSQL; its tests have the mark `postgres`."""
    with require_postgres() as url:
        yield url


@contextlib.contextmanager
def require_postgres(*, migrated: bool = True) -> Iterator[str]:
    """A database of PostgreSQL while the block runs; skips the test where there is no PostgreSQL."""
    try:
        start_server()
    except NoPostgresError as error:
        pytest.skip(str(error))
    with make_database(migrated=migrated) as url:
        yield url
