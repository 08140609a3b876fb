"""What is shipped: the Dockerfile by the rules (it is read, not built), the wheel's contents, the licence."""

from __future__ import annotations

import json
import re
import tomllib
from importlib import metadata

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

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
