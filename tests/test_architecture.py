"""The laws of the house: imports go one way, core stays pure, modules stay short."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from tests.data import ROOT

ALLOWED_IN_CORE = {"numpy", "scipy", "numba", "core"}
ALLOWED_IN_FORMATS = ALLOWED_IN_CORE | {"pyarrow", "defusedxml", "h5py"}
DATED = ("core/sample_blocks.py", "core/activity/result.py", "core/activity/totals.py", "core/formats/cwa.py")
"""They hold dates that a device's file has written; none asks what time it is."""
COMPILER = "core/body/erkf/lanes.py"
"""It tells Numba's compiler, which is llvmlite, what eight numbers of a row are."""
EFFECTS = {
    "socket",
    "http",
    "urllib",
    "sqlite3",
    "subprocess",
    "multiprocessing",
    "random",
    "secrets",
    "datetime",
    "time",
}


def imported_packages(source: str) -> set[str]:
    """Top-level packages a module imports anywhere, type checking blocks included."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.split(".")[0])
    return names


def outsiders(path: Path) -> set[str]:
    """Packages a core module may not import."""
    allowed = ALLOWED_IN_FORMATS if "formats" in path.parts else ALLOWED_IN_CORE
    if str(path).endswith(DATED):
        allowed = allowed | {"datetime"}
    if str(path).endswith(COMPILER):
        allowed = allowed | {"llvmlite"}
    found = imported_packages(path.read_text("utf-8"))
    return (found - allowed - set(sys.stdlib_module_names)) | (found & (EFFECTS - allowed))


@pytest.mark.parametrize(
    "path", sorted((ROOT / "core").rglob("*.py")), ids=lambda p: str(p.relative_to(ROOT))
)
def test_core_imports_only_what_the_law_names(path: Path) -> None:
    assert outsiders(path) == set()


def test_a_planted_import_is_found(tmp_path: Path) -> None:
    planted = tmp_path / "core" / "planted.py"
    planted.parent.mkdir()
    planted.write_text("def f():\n    import time, requests\n    from sqlalchemy.orm import Session\n")
    assert outsiders(planted) == {"time", "requests", "sqlalchemy"}


NEEDED_BY_OTHERS = {"python-multipart"}
"""Starlette reads forms with it and imports it only then."""


def test_every_dependency_is_imported_by_what_is_shipped() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    declared = {re.split(r"[^a-z0-9-]", line)[0] for line in project["dependencies"]}
    imported = {
        package
        for folder in ("core", "sagittal", "server", "web", "migrations")
        for path in (ROOT / folder).rglob("*.py")
        for package in imported_packages(path.read_text("utf-8"))
    }
    providers = packages_distributions()
    used = {name.lower().replace("_", "-") for package in imported for name in providers.get(package, ())}
    assert declared - used == NEEDED_BY_OTHERS


def test_no_compiled_loop_of_core_may_reorder_sums() -> None:
    """With numba's fastmath the last bits depend on whether the code was compiled just now or loaded."""
    assert not [p for p in (ROOT / "core").rglob("*.py") if "fastmath" in p.read_text(encoding="utf-8")]


@pytest.mark.parametrize("folder", ["core", "sagittal", "server", "web"])
def test_no_module_is_longer_than_500_lines(folder: str) -> None:
    long = {
        str(p.relative_to(ROOT)): n
        for p in (ROOT / folder).rglob("*")
        if p.suffix in {".py", ".js", ".html"} and (n := len(p.read_text("utf-8").splitlines())) > 500
    }
    assert long == {}


def test_only_fs_opens_files_for_writing() -> None:
    writers = []
    for path in sorted((ROOT / "server").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            modes = [
                a.value
                for a in (*node.args, *(k.value for k in node.keywords if k.arg == "mode"))
                if isinstance(a, ast.Constant) and isinstance(a.value, str) and len(a.value) <= 3
            ]
            writes = name == "open" and any(set(m) & set("wax+") and set(m) <= set("rwaxbt+") for m in modes)
            if writes or name in {"write_text", "write_bytes"}:
                writers.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert [w for w in writers if not w.startswith("server/storage/fs.py")] == []


def linted(folder: Path) -> subprocess.CompletedProcess[str]:
    lint = Path(sys.executable).with_name("lint-imports")
    return subprocess.run(
        [str(lint), "--no-cache"], cwd=folder, capture_output=True, text=True, check=False, timeout=120
    )


def test_import_contracts_hold_and_a_planted_violation_breaks_them(tmp_path: Path) -> None:
    for name in ("core", "sagittal", "server", "web"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__", "static"))
    shutil.copy(ROOT / ".importlinter", tmp_path)
    (tmp_path / "web" / "__init__.py").touch()
    clean = linted(tmp_path)
    assert clean.returncode == 0, clean.stdout
    errors = tmp_path / "core" / "errors.py"
    errors.write_text(errors.read_text("utf-8") + "\nimport core.angles\nimport server.settings\n")
    tables = tmp_path / "server" / "storage" / "tables.py"
    tables.write_text(tables.read_text("utf-8") + "\nimport server.pages.shell\n")
    broken = linted(tmp_path)
    assert broken.returncode == 1
    assert "core: data walks in one direction BROKEN" in broken.stdout
    assert "core knows nothing of server, web and the world outside BROKEN" in broken.stdout
    assert "server: a room uses the rooms below it BROKEN" in broken.stdout
    assert "server: no circle of modules BROKEN" in broken.stdout
