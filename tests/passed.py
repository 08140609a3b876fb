"""Several runs that share the work: each leaves out what has passed before.

`.ci/run` runs first what a newcomer runs, then the rest with the recordings, then what has not passed.
A test is left out only when it has passed, so none is lost, whatever marks and folders say.
"""

from __future__ import annotations

from pathlib import Path

import pytest


class Passed:
    """Leaves out the tests that a file names, and adds those that pass.

    Parameters
    ----------
    path : one test a line, by its id; made at the end of the first run.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._passed: set[str] = set()
        self._not: set[str] = set()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Deselect what has passed before."""
        before = self._read()
        left_out = [item for item in items if item.nodeid in before]
        if left_out:
            items[:] = [item for item in items if item.nodeid not in before]
            config.hook.pytest_deselected(items=left_out)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note the outcome: all of setup, call and teardown must pass."""
        if not report.passed:
            self._not.add(report.nodeid)
        elif report.when == "call":
            self._passed.add(report.nodeid)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write the file, once all is over: a test process that starts late must see what the others saw."""
        if not hasattr(session.config, "workerinput"):
            names = self._read() | (self._passed - self._not)
            self._path.write_text("".join(f"{name}\n" for name in sorted(names)), encoding="utf-8")

    def _read(self) -> set[str]:
        return set(self._path.read_text("utf-8").splitlines()) if self._path.exists() else set()
