"""pytest hooks shared by tests/ and validation/: options, marks, order and compilation."""

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

from sagittal.server.processes.compiling import compile_filters
from sagittal.server.processes.environment import ONE_THREAD
from sagittal.server.storage.compile_cache import has_compiled_filters, share_compile_cache
from tests.data import ENGINE, NO_RECORDINGS, ROOT

# before anything imports numba: every process that a test starts inherits it
share_compile_cache(Path(tempfile.gettempdir()) / "sagittal-tests")
# and before anything imports numpy: sums are split over as many threads as in the product
os.environ.update(ONE_THREAD)

MEMORY_DISK: Final = Path("/dev/shm")  # noqa: S108
REQUIRED_SPACE: Final = 8 << 30
"""Free bytes required there."""

# thousands of databases and logs are synced: keep them in memory. Power loss, full and broken disks are
# modelled in the fault tests
if MEMORY_DISK.is_dir() and shutil.disk_usage(MEMORY_DISK).free > REQUIRED_SPACE:
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY_DISK))

# no deadline: a busy machine must not fail a property
hypothesis.settings.register_profile(
    "sagittal", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("sagittal")

TESTS: Final = ROOT / "tests"
MARKED: Final = ("browser", "faults")
"""Folders of long tests; each is a mark of the same name."""
FIRST: Final = "pytest.mark.first"
"""Appears in the files of marked folders that have a test for every run; the others are not imported then."""
ORDER: Final = ("core", "server", "web", "lint", "helpers", "test_", "acceptance", "faults", "browser")
"""Order of the folders: cheap tests first. Browser tests last: while Playwright drives Chromium an event loop
runs in its thread, which other tests must not meet."""
MARKS_WITH_RECORDINGS: Final = frozenset({"recorded", "slow", "sweep", *MARKED, "bench", "postgres"})
"""Tests with one of these marks also run where recordings are available."""
LONGEST: Final = ("test_capture.py", "test_german.py", "test_live.py", "test_look.py", "test_replay.py")
"""Files of minutes: first in their folder, so that no process is left alone with one at the end."""


@pytest.fixture(scope="session")
def anyio_backend() -> str:
    """Event loop of every asynchronous test, and of fixtures that outlive one."""
    return "asyncio"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--engine` and `--recordings`."""
    parser.addoption(
        "--engine",
        choices=("sqlite", "postgresql"),
        default="sqlite",
        help="database of every clinic whose test names none",
    )
    parser.addoption(
        "--recordings",
        type=int,
        default=0,
        metavar="N",
        help="recordings queued by the load test (default: skip it); four workers from 200",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Publish the engine to all test processes; run files named on the command line whole."""
    os.environ.setdefault(ENGINE, config.getoption("--engine"))
    if config.option.markexpr == _default_marks(config) and any(map(_names_a_file, _named(config))):
        config.option.markexpr = ""


def _named(config: pytest.Config) -> list[str]:
    """Files, folders and tests named on the command line."""
    return config.args if config.args_source is config.ArgsSource.ARGS else []


def _default_marks(config: pytest.Config) -> str:
    options: list[str] = config.getini("addopts")
    return options[options.index("-m") + 1]


def _names_a_file(argument: str) -> bool:
    """Whether a command-line argument is a test file, a test, or a marked folder."""
    path = Path(argument.partition("::")[0])
    return path.suffix == ".py" or path.name in MARKED


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the filters once, instead of in every test process, server and estimator at a time."""
    config = session.config
    is_worker = hasattr(config, "workerinput")
    if is_worker or config.option.collectonly or _named(config) or has_compiled_filters():
        return
    sys.stdout.write("Compiling the filters (once for you and this version, about a minute) …\n")
    sys.stdout.flush()
    compile_filters()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Pause garbage collection while thousands of tests are collected, and exempt them from it afterwards."""
    gc.disable()
    try:
        return (yield)
    finally:
        if "numba" in sys.modules:
            from tests.helpers.compiling import compile_one_at_a_time

            compile_one_at_a_time()
        gc.freeze()
        gc.enable()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Skip importing files of a marked folder when the default marks deselect all their tests."""
    if config.option.markexpr != _default_marks(config) or collection_path.suffix != ".py":
        return None
    if _folder(collection_path) not in MARKED:
        return None
    return True if FIRST not in collection_path.read_text("utf-8") else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of marked folders, and order the folders."""
    for item in items:
        if (folder := _folder(item.path)) in MARKED:
            item.add_marker(folder)
    items.sort(key=lambda item: (_rank(_folder(item.path)), item.path.name not in LONGEST))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Fail a test that skips for want of recordings without the mark `recorded`: no run would include it."""
    report = yield
    needs_recordings = report.skipped and NO_RECORDINGS in str(report.longrepr)
    if needs_recordings and not MARKS_WITH_RECORDINGS & {mark.name for mark in item.iter_markers()}:
        report.outcome = "failed"
        report.longrepr = "needs real recordings: mark it @pytest.mark.recorded"
    return report


def _folder(path: Path) -> str:
    """First folder (or file) below tests/; "" elsewhere."""
    return path.relative_to(TESTS).parts[0] if path.is_relative_to(TESTS) else ""


def _rank(folder: str) -> int:
    return next((i for i, name in enumerate(ORDER) if folder.startswith(name)), len(ORDER))
