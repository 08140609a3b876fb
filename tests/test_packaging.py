"""What is shipped: the Dockerfile by the rules (it is read, not built), wheel and sdist, version, licence."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

import sagittal
from tests.data import ROOT

DOCKERFILE = (ROOT / "Dockerfile").read_text("utf-8")
INSTRUCTIONS = re.findall(r"^([A-Z]+)\s+(.*)$", re.sub(r"\\\n\s*", " ", DOCKERFILE), re.MULTILINE)


def last(name: str) -> str:
    return str([value for key, value in INSTRUCTIONS if key == name][-1])


def test_container_runs_as_a_plain_user_after_all_root_work() -> None:
    assert last("USER") == "sagittal"
    assert "--uid 10001" in DOCKERFILE
    order = [key for key, _ in INSTRUCTIONS]
    assert "RUN" not in order[order.index("USER") :]


def test_container_keeps_data_in_a_volume_and_caches_there() -> None:
    assert json.loads(last("VOLUME")) == ["/data"]
    environment = last("ENV")
    assert "SAGITTAL_HOME=/data" in environment
    assert "XDG_CACHE_HOME=/data/cache" in environment


def test_container_starts_without_a_shell_and_checks_its_health() -> None:
    assert json.loads(last("CMD")) == ["sagittal", "serve"]
    health = last("HEALTHCHECK")
    assert "/health/live" in health
    assert isinstance(json.loads(health.split("CMD", 1)[1]), list)
    assert last("STOPSIGNAL") == "SIGTERM"


def test_container_copies_every_package_of_the_wheel() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    copied = {value.split()[0] for key, value in INSTRUCTIONS if key == "COPY"}
    assert set(wheel["packages"]) | set(wheel["force-include"]) <= copied
    assert project["project"]["license"] == "MIT"
    assert (ROOT / "LICENSE").read_text("utf-8").startswith("MIT License")


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
EXTRAS = PROJECT["project"]["optional-dependencies"]
INSTALLED = re.findall(r"--extra (\w+)", (ROOT / ".ci/lock").read_text("utf-8"))
"""The extras that the image has."""
LOCKS = {
    "requirements.lock": [
        *PROJECT["project"]["dependencies"],
        *(one for extra in INSTALLED for one in EXTRAS[extra]),
    ],
    "requirements-image.lock": PROJECT["dependency-groups"]["image"],
}


@pytest.mark.parametrize("name", LOCKS)
def test_the_lock_covers_what_is_declared_and_every_version_has_hashes(name: str) -> None:
    text = (ROOT / name).read_text("utf-8")
    entries = re.findall(r"^([\w.-]+)==(\S+)((?:.*\\\n)*.*)$", text, re.MULTILINE)
    locked: dict[str, list[Version]] = {}
    for package, version, rest in entries:
        locked.setdefault(canonicalize_name(package), []).append(Version(version))
        assert re.search(r"--hash=sha256:[0-9a-f]{64}", rest), f"{package} has no hash; run .ci/lock"
    assert sum(map(len, locked.values())) == len(re.findall(r"^\w", text, re.MULTILINE)), "an unknown line"
    declared = [Requirement(one) for one in LOCKS[name]]
    for one in declared:
        versions = locked.get(canonicalize_name(one.name), [])
        assert versions, f"{one.name} is not in {name}; run .ci/lock"
        assert all(v in one.specifier for v in versions), f"{one}: {name} has another version; run .ci/lock"
    # and what these need in their turn, as far as the same is installed here
    for package in locked:
        try:
            if Version(metadata.version(package)) not in locked[package]:
                continue  # another version may need others
            needs = metadata.requires(package) or []
        except metadata.PackageNotFoundError:
            continue
        for need in map(Requirement, needs):
            if need.marker is None or need.marker.evaluate({"extra": ""}):
                assert canonicalize_name(need.name) in locked, f"{package} needs {need.name}; run .ci/lock"


def test_the_image_installs_nothing_without_its_hash_and_lists_what_is_in_it() -> None:
    installs = re.findall(r"pip install ([^&\n]*)", DOCKERFILE)
    assert len(installs) == 3
    for one in installs:
        assert "--require-hashes" in one or {"--no-deps", "--no-index"} <= set(one.split()), one
    for name in LOCKS:
        assert f"--require-hashes -r {name}" in DOCKERFILE
    assert "cyclonedx-py environment" in DOCKERFILE


BUILD = """
import sys
from hatchling.build import build_sdist, build_wheel
print({"wheel": build_wheel, "sdist": build_sdist}[sys.argv[1]](sys.argv[2]))
"""


def build(kind: str, tree: Path, folder: Path) -> Path:
    """Build a wheel or an sdist of a tree by hatchling, as pip does without isolation."""
    if importlib.util.find_spec("hatchling") is None:
        pytest.skip("hatchling is not installed")
    folder.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", BUILD, kind, str(folder)],
        cwd=tree,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder / done.stdout.split()[-1]


def list_wheel(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", ROOT, tmp_path_factory.mktemp("built") / "wheel")


@pytest.mark.slow
def test_the_wheel_has_one_package_with_all_that_it_reads(wheel: Path) -> None:
    names = list_wheel(wheel)
    information = f"sagittal-{sagittal.__version__}.dist-info"
    assert {name.split("/")[0] for name in names} == {"sagittal", information}
    for folder in ("core", "server", "web"):
        tracked = {
            f"sagittal/{path.relative_to(ROOT).as_posix()}"
            for path in (ROOT / folder).rglob("*")
            if path.is_file() and "__pycache__" not in path.parts and path.suffix not in {".nbi", ".nbc"}
        }
        left_out = {f"sagittal/web/{name}" for name in ("dom.d.ts", "eslint.config.mjs", "jsconfig.json")}
        assert tracked - names <= left_out
    migrations = {path.name for path in (ROOT / "migrations/versions").glob("0*.py")}
    assert {
        Path(name).name for name in names if name.startswith("sagittal/server/migrations/versions/0")
    } == (migrations)
    assert {"sagittal/py.typed", "sagittal/web/texts/de.po", f"{information}/licenses/LICENSE"} <= names
    assert any(name.startswith("sagittal/web/templates/") for name in names)


@pytest.mark.slow
def test_an_sdist_makes_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    """Also where the links have become folders, as in an archive of a clone."""
    sdist = build("sdist", ROOT, tmp_path / "sdist")
    with tarfile.open(sdist) as archive:
        assert not [member.name for member in archive if member.issym() or member.islnk()]
        archive.extractall(tmp_path, filter="data")
    again = build("wheel", tmp_path / f"sagittal-{sagittal.__version__}", tmp_path / "again")
    assert list_wheel(again) == list_wheel(wheel)


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel as pip lays it out, beside everything that it needs."""
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)  # noqa: S202 - our own
    return folder


def run_in(folder: Path, code: str, site: Path) -> subprocess.CompletedProcess[str]:
    # -m puts the folder one stands in first, as an interactive Python and a notebook do
    code = f"import sys; sys.path.insert(0, {str(site)!r}); sys.path.insert(0, {str(folder)!r}); {code}"
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_a_folder_of_somebody_with_a_core_a_server_and_a_web_is_not_in_the_way(
    installed: Path, tmp_path: Path
) -> None:
    (tmp_path / "core").mkdir()
    (tmp_path / "web").mkdir()
    for name in ("core/__init__.py", "server.py", "web/__init__.py"):
        (tmp_path / name).write_text("raise RuntimeError('somebody else')\n")
    code = (
        "import sagittal, sagittal.core.pipeline, sagittal.server.app; "
        "from sagittal.server.main import main; main(['--version']); print(sagittal.__file__)"
    )
    done = run_in(tmp_path, code, installed)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[:2] == [
        f"sagittal {sagittal.__version__}", str(installed / "sagittal/__init__.py"),
    ]  # fmt: skip


def test_a_clone_whose_links_are_texts_says_what_to_do(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "sagittal", tmp_path / "sagittal", symlinks=True)
    (tmp_path / "sagittal/core").unlink()
    (tmp_path / "sagittal/core").write_text("../core")
    done = run_in(tmp_path, "import sagittal", tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("ImportError: ")
    assert "git config core.symlinks true" in done.stderr.splitlines()[-1]


@pytest.mark.slow
def test_pyright_finds_every_import_of_the_wheel(installed: Path, tmp_path: Path) -> None:
    if importlib.util.find_spec("pyright") is None:
        pytest.skip("pyright is not installed")
    names = sorted(path.relative_to(installed) for path in (installed / "sagittal").rglob("*.py"))
    modules = [".".join(name.with_suffix("").parts).removesuffix(".__init__") for name in names]
    code = "".join(f"import {module}\n" for module in modules if "migrations" not in module)
    (tmp_path / "all.py").write_text(code)
    config = {"extraPaths": [str(installed)], "include": ["all.py"], "typeCheckingMode": "off"}
    config["reportMissingImports"] = "error"
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(config))
    done = subprocess.run(
        [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, "-p", str(tmp_path)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


def test_version_and_citation_are_those_of_the_code() -> None:
    assert PROJECT["tool"]["hatch"]["version"] == {"path": "sagittal/__init__.py"}
    citation: Mapping[str, object] = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["cff-version"] == "1.2.0"
    assert citation["version"] == str(Version(sagittal.__version__)) == sagittal.__version__
    assert citation["authors"] == [{"name": "Sagittal contributors"}]
    assert citation["license"] == PROJECT["project"]["license"]
    assert f"## {sagittal.__version__}" in (ROOT / "CHANGELOG.md").read_text("utf-8")
