"""Databases for tests that run on both engines; a room's conftest imports these fixtures.

@on_both_engines                    # every clinic of the test: on a file, then on PostgreSQL
def test_something(clinic: Clinic) -> None: ...
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from sagittal.server.settings import Settings
from sagittal.server.storage.db import Source
from tests.data import ENGINE
from tests.helpers.databases import write_database
from tests.helpers.postgres import NoPostgresError, make_database, make_lasting_database, start_server

ENGINES: Final = ("sqlite", pytest.param("postgresql", marks=pytest.mark.postgres))
on_both_engines: Final = pytest.mark.parametrize("engine", ENGINES, indirect=True)
"""The one on PostgreSQL runs with the mark `postgres`."""

_in_force: list[str] = []
_lasting: dict[Path, str] = {}


def choose_url(folder: Path) -> str:
    """`database_url` of a clinic on this folder ("" = SQLite file), the same on every call.

    Skips the test if PostgreSQL is requested but not installed.
    """
    if (_in_force or [_find_usual()])[-1] == "sqlite":
        return ""
    if folder not in _lasting:
        try:
            _lasting[folder] = make_lasting_database()
        except NoPostgresError as error:
            pytest.skip(str(error))
    return _lasting[folder]


def tell_commands(monkeypatch: pytest.MonkeyPatch, settings: Settings) -> None:
    """Let commands of the test find the clinic's database, as an administrator's environment does."""
    monkeypatch.setenv("SAGITTAL_DATABASE_URL", settings.database_url)


def _find_usual() -> str:
    """Value of `--engine`, read lazily because this module is imported before the option is parsed."""
    return os.environ.get(ENGINE, "sqlite")


@pytest.fixture(scope="module", autouse=True)
def engine(request: pytest.FixtureRequest) -> Iterator[str]:
    """Default database of tests that name none; clinics shared between tests must request it."""
    _in_force.append(getattr(request, "param", _find_usual()))
    yield _in_force[-1]
    _in_force.pop()


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
