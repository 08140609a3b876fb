"""The architecture rules detect planted violations."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.data import ROOT
from tests.lint.architecture import outsiders


def test_a_planted_import_is_found(tmp_path: Path) -> None:
    planted = tmp_path / "core" / "planted.py"
    planted.parent.mkdir()
    planted.write_text("def f():\n    import time, requests\n    from sqlalchemy.orm import Session\n")
    assert outsiders(planted) == {"time", "requests", "sqlalchemy"}


def linted(folder: Path) -> subprocess.CompletedProcess[str]:
    lint = Path(sys.executable).with_name("lint-imports")
    return subprocess.run(
        [str(lint), "--no-cache"], cwd=folder, capture_output=True, text=True, check=False, timeout=120
    )


@pytest.mark.slow
def test_import_contracts_hold_and_a_planted_violation_breaks_them(tmp_path: Path) -> None:
    package = tmp_path / "sagittal"
    shutil.copytree(ROOT / "sagittal", package, ignore=shutil.ignore_patterns("__pycache__", "static"))
    shutil.copy(ROOT / ".importlinter", tmp_path)
    clean = linted(tmp_path)
    assert clean.returncode == 0, clean.stdout
    errors = package / "core" / "errors.py"
    errors.write_text(
        errors.read_text("utf-8") + "\nimport sagittal.core.angles\nimport sagittal.server.settings\n"
    )
    tables = package / "server" / "storage" / "schema" / "tables.py"
    tables.write_text(tables.read_text("utf-8") + "\nimport sagittal.server.pages.shell\n")
    broken = linted(tmp_path)
    assert broken.returncode == 1
    assert "core: data walks in one direction BROKEN" in broken.stdout
    assert "core knows nothing of server, web and the world outside BROKEN" in broken.stdout
    assert "server: a room uses the rooms below it BROKEN" in broken.stdout
    assert "server: no circle of modules BROKEN" in broken.stdout
