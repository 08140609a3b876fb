"""Settings of all tests."""

from __future__ import annotations

import gc
import os
import shutil
import sys
import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import Final

import hypothesis
import pytest

from server.processes.compiling import compile_filters
from server.processes.environment import ONE_THREAD
from server.storage.compile_cache import has_compiled_filters, share_compile_cache
from tests.accuracy.report import WRITE
from tests.data import ENGINE
from tests.passed import Passed

# before anything imports numba: every process that a test starts inherits it
share_compile_cache(Path(tempfile.gettempdir()) / "sagittal-tests")
# and before anything imports numpy: sums are split over as many threads as in the product
os.environ.update(ONE_THREAD)

MEMORY_DISK: Final = Path("/dev/shm")  # noqa: S108
ROOM: Final = 8 << 30
"""Bytes that must be free there."""

# a test waits for no disk: thousands of databases and logs are synced. What a disk does when the power is
# lost, when it is full or broken is modelled in tests/faults
if MEMORY_DISK.is_dir() and shutil.disk_usage(MEMORY_DISK).free > ROOM:
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY_DISK))

# a busy machine must not fail a property: the clock says nothing about it
hypothesis.settings.register_profile(
    "sagittal", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("sagittal")

MARKED: Final = ("accuracy", "bench", "browser", "faults")
"""Folders of long tests; each is a mark of the same name."""
FIRST: Final = "pytest.mark.first"
"""Written in the files of long folders that have a test for every run; the others are not imported then."""
ORDER: Final = ("core", "server", "web", "test_", "accuracy", "acceptance", "faults", "bench", "browser")
"""Which tests come first: what a change breaks is seen in the first seconds. Pages are last: while Chromium
is driven an event loop runs in its thread, which others must not find."""
LONGEST: Final = ("test_capture.py", "test_german.py", "test_live.py", "test_look.py", "test_replay.py")
"""Files of minutes: first in their room, so that no process is left alone with one at the end."""


@pytest.fixture(scope="session")
def anyio_backend() -> str:
    """The loop of every asynchronous test and of fixtures that outlive one."""
    return "asyncio"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of our own."""
    parser.addoption(
        "--write-figures", action="store_true", help="write docs/accuracy.md instead of comparing with it"
    )
    parser.addoption(
        "--engine",
        choices=("sqlite", "postgresql"),
        default="sqlite",
        help="the database of every clinic whose test names none",
    )
    parser.addoption(
        "--recordings",
        type=int,
        default=0,
        metavar="N",
        help="how many recordings the load test queues (none: it is left out); from 200 on four workers",
    )
    parser.addoption(
        "--passed",
        type=Path,
        metavar="FILE",
        help="leave out the tests that FILE names, and add those that pass: several runs with one FILE "
        "run every test once",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Tell every test process whether figures are written; run what is named, be it long or not."""
    os.environ.setdefault(ENGINE, config.getoption("--engine"))
    if config.getoption("--write-figures"):
        os.environ[WRITE] = "1"
    if config.option.markexpr == _usual_marks(config) and any(map(_names_a_file, _named(config))):
        config.option.markexpr = ""
    if config.getoption("--passed"):
        config.pluginmanager.register(Passed(config.getoption("--passed")))


def _named(config: pytest.Config) -> list[str]:
    """Files, folders and tests that the command line names."""
    return config.args if config.args_source is config.ArgsSource.ARGS else []


def _usual_marks(config: pytest.Config) -> str:
    options: list[str] = config.getini("addopts")
    return options[options.index("-m") + 1]


def _names_a_file(argument: str) -> bool:
    """Whether a command line's word is a test file, a test, or one of the long folders."""
    path = Path(argument.partition("::")[0])
    return path.suffix == ".py" or path.name in MARKED


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the filters once, before test processes, servers and estimators would all do it at a time."""
    config = session.config
    is_one_of_several = hasattr(config, "workerinput")
    if is_one_of_several or config.option.collectonly or _named(config) or has_compiled_filters():
        return
    sys.stdout.write("Compiling the filters (once for you and this version, about a minute) …\n")
    sys.stdout.flush()
    compile_filters()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Do not look for garbage while thousands of tests are made, nor among them afterwards."""
    gc.disable()
    try:
        return (yield)
    finally:
        if "numba" in sys.modules:
            from tests.compiling import compile_one_at_a_time

            compile_one_at_a_time()
        gc.freeze()
        gc.enable()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not import a file of a long folder when the usual marks leave out all its tests."""
    if config.option.markexpr != _usual_marks(config) or collection_path.suffix != ".py":
        return None
    room = collection_path.relative_to(Path(__file__).parent).parts[0]
    return True if room in MARKED and FIRST not in collection_path.read_text("utf-8") else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of long folders, and put unit tests first."""
    here = Path(__file__).parent
    for item in items:
        room = item.path.relative_to(here).parts[0]
        if room in MARKED:
            item.add_marker(room)
    items.sort(key=lambda item: (_rank(item.path.relative_to(here).parts[0]), item.path.name not in LONGEST))


def _rank(room: str) -> int:
    return next(i for i, name in enumerate(ORDER) if room.startswith(name))
