"""Architecture rules: core imports only pure packages, modules stay short, only fs writes files."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

from tests.data import ROOT

ALLOWED_IN_CORE = {"numpy", "scipy", "numba", "sagittal"}
ALLOWED_IN_FORMATS = ALLOWED_IN_CORE | {"pyarrow", "defusedxml", "h5py", "openpyxl"}
DATED = (
    "core/signals/sample_blocks.py",
    "core/activity/result.py",
    "core/activity/totals.py",
    "core/formats/vendors/cwa.py",
    "core/message.py",
)
"""They handle dates read from a device's file or given to a message; none reads the clock."""
COMPILER = "core/body/erkf/vector_lanes.py"
"""It extends Numba's compiler, llvmlite, by a vector type."""
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
    """Top-level packages a module imports anywhere, type-checking blocks included."""
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
    result = imported_packages(path.read_text("utf-8"))
    return (result - allowed - set(sys.stdlib_module_names)) | (result & (EFFECTS - allowed))


def find_impure_imports() -> list[str]:
    """Imports of core that its architecture forbids."""
    return [
        f"{path.relative_to(ROOT)}: imports {', '.join(sorted(names))}"
        for path in sorted((ROOT / "core").rglob("*.py"))
        if (names := outsiders(path))
    ]


NEEDED_BY_OTHERS = {"python-multipart"}
"""Starlette reads forms with it and imports it only then."""


def find_unused_dependencies() -> list[str]:
    """Declared dependencies that nothing shipped imports."""
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
    return [f"pyproject.toml: {name}" for name in sorted((declared - used) ^ NEEDED_BY_OTHERS)]


def find_fastmath() -> list[str]:
    """Kernels of core that may reorder sums, so that last bits depend on when they were compiled."""
    return [
        str(path.relative_to(ROOT))
        for path in sorted((ROOT / "core").rglob("*.py"))
        if "fastmath" in path.read_text(encoding="utf-8")
    ]


MOST_LINES = 500


def find_long_modules() -> list[str]:
    """Modules, scripts and templates of more than 500 lines."""
    return [
        f"{path.relative_to(ROOT)}: {lines} lines"
        for folder in ("core", "sagittal", "server", "web")
        for path in sorted((ROOT / folder).rglob("*"))
        if path.suffix in {".py", ".js", ".html"}
        and (lines := len(path.read_text("utf-8").splitlines())) > MOST_LINES
    ]


def find_writers() -> list[str]:
    """Places of the server outside server/storage/fs.py that open files for writing."""
    writers = []
    for path in sorted((ROOT / "server").rglob("*.py")):
        if path.relative_to(ROOT) == Path("server/storage/fs.py"):
            continue
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
    return writers
