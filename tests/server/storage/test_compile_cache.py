from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sagittal.server.processes.environment import make_environment
from sagittal.server.settings import Settings
from sagittal.server.storage.compile_cache import (
    KEEP_S,
    find_compile_cache,
    fingerprint_filters,
    share_compile_cache,
)
from tests.data import ROOT

FILTER = """from numba import njit
from sagittal.core.frames import G
from sagittal.core import (
    angles,
)
@njit
def f(x): return G
"""


@pytest.fixture(autouse=True)
def _newcomer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No variable set, a home of our own."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))


def test_two_data_folders_share_what_has_been_compiled(tmp_path: Path) -> None:
    first = make_environment(Settings(data_dir=tmp_path / "one"))["NUMBA_CACHE_DIR"]
    second = make_environment(Settings(data_dir=tmp_path / "two"))["NUMBA_CACHE_DIR"]
    assert first == second
    assert Path(first).parent == tmp_path / "caches" / "sagittal"


@pytest.mark.slow
def test_a_second_process_compiles_nothing_again(tmp_path: Path) -> None:
    code = (
        "from sagittal.core.fusion import attitude; attitude.compile_attitude_kernel();"
        "s = attitude.attitude_kernel.stats; print(len(s.cache_hits), len(s.cache_misses))"
    )
    message = []
    for name in ("one", "two"):
        env = {**make_environment(Settings(data_dir=tmp_path / name)), "PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True
        )
        message.append(tuple(map(int, done.stdout.split())))
    assert message[0] == (0, 1)
    assert message[1] == (1, 0)


def test_the_data_folder_is_used_where_the_cache_folder_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "caches").write_text("a file stands in the way")
    folder = find_compile_cache(os.environ, tmp_path / "data" / "cache")
    assert folder.parent == tmp_path / "data" / "cache"


def test_the_folder_of_another_user_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.getuid", lambda: 4711)
    assert find_compile_cache(os.environ, tmp_path / "cache").parent == tmp_path / "cache"


def test_a_folder_that_the_environment_names_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "mine"))
    assert share_compile_cache(tmp_path) == tmp_path / "mine"


def test_without_a_home_the_fallback_is_used(tmp_path: Path) -> None:
    assert find_compile_cache({"HOME": ""}, tmp_path).parent == tmp_path


def test_versions_that_nobody_uses_any_more_are_removed(tmp_path: Path) -> None:
    old, young = (tmp_path / "caches" / "sagittal" / f"filters-{n}" for n in ("old", "young"))
    for alternative in (old, young):
        (alternative / "body_1").mkdir(parents=True)
    long_ago = time.time() - KEEP_S - 60
    os.utime(old, (long_ago, long_ago))
    find_compile_cache(os.environ, tmp_path)
    assert not old.exists()
    assert young.exists()


def test_two_installations_of_one_version_have_folders_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second installation took the filters of the first for its own and compiled for minutes in silence."""
    folders = set()
    for name in ("one", "two"):
        package = tmp_path / name / "core"
        package.mkdir(parents=True)
        (package / "kernel.py").write_text(FILTER)
        monkeypatch.setattr("sagittal.core.__file__", str(package / "__init__.py"))
        folder = find_compile_cache(os.environ, tmp_path)
        (folder / "core_0").mkdir()
        (folder / "core_0" / "kernel.nbi").write_bytes(b"")
        folders.add(folder)
    assert len(folders) == 2


def test_the_version_changes_with_every_source_a_filter_is_made_of(tmp_path: Path) -> None:
    (tmp_path / "events").mkdir()
    sources = {"events/kernel.py": FILTER, "frames.py": "G = 9.81\n", "angles.py": "", "report.py": ""}
    for name, text in sources.items():
        (tmp_path / name).write_text(text)
    initial = fingerprint_filters(tmp_path)
    (tmp_path / "report.py").write_text("no filter uses it")
    assert fingerprint_filters(tmp_path) == initial
    observations = {initial}
    for name in ("events/kernel.py", "frames.py", "angles.py"):
        (tmp_path / name).write_text(sources[name] + "# changed\n")
        observations.add(fingerprint_filters(tmp_path))
    assert len(observations) == 4
