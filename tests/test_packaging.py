"""What is shipped: the Dockerfile by the rules (it is read, not built), the wheel's contents, the licence."""

from __future__ import annotations

import json
import re
import tomllib

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
