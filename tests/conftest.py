"""Settings of all tests."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

import hypothesis
import pytest

from server.processes.compile_cache import has_compiled_filters, share_compile_cache
from tests.accuracy.report import WRITE

# before anything imports numba: every process that a test starts inherits it
share_compile_cache(Path(tempfile.gettempdir()) / "sagittal-tests")

# a busy machine must not fail a property: the clock says nothing about it
hypothesis.settings.register_profile(
    "sagittal", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("sagittal")

MARKED: Final = ("accuracy", "bench", "browser", "faults")
"""Folders of long tests; each is a mark of the same name."""
ORDER: Final = ("core", "server", "test_", "accuracy", "acceptance", "faults", "browser", "bench")
"""Which tests come first: what a change breaks is seen in the first seconds."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that lets accuracy tests write docs/accuracy.md."""
    parser.addoption(
        "--write-figures", action="store_true", help="write docs/accuracy.md instead of comparing with it"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Tell every test process whether figures are written; run what is named, be it long or not."""
    if config.getoption("--write-figures"):
        os.environ[WRITE] = "1"
    if config.option.markexpr == _usual_marks(config) and any(map(_names_a_file, _named(config))):
        config.option.markexpr = ""


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
    command = [sys.executable, "-c", "from core.online import warm; warm()"]
    subprocess.run(command, cwd=Path(__file__).parent.parent, check=True)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of long folders, and put unit tests first."""
    here = Path(__file__).parent
    for item in items:
        room = item.path.relative_to(here).parts[0]
        if room in MARKED:
            item.add_marker(room)
    items.sort(key=lambda item: _rank(item.path.relative_to(here).parts[0]))


def _rank(room: str) -> int:
    return next(i for i, name in enumerate(ORDER) if room.startswith(name))
