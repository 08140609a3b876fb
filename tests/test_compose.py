"""compose.yaml and the Dockerfile, which no check here can run, held against what they speak of."""

from __future__ import annotations

import dataclasses
import ipaddress
import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement
from sqlalchemy import make_url

from sagittal.server.main import make_app
from sagittal.server.settings import Settings, load_settings
from tests.data import ROOT
from tests.helpers.clinic import open_clinic
from tests.test_packaging import EXTRAS, INSTRUCTIONS, last

TEXT = (ROOT / "compose.yaml").read_text("utf-8")
COMPOSE: dict[str, Any] = yaml.safe_load(TEXT.replace("${SAGITTAL_DOMAIN", "${"))
"""With the one variable that a person gives left for `fill`."""
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
OURS = {name: service for name, service in SERVICES.items() if service.get("image") == "sagittal"}
WEB = ("web-a", "web-b")
DOMAIN = "gait.clinic.example"
VARIABLES = {"SAGITTAL_HOME"} | {
    f"SAGITTAL_{field.name.upper()}" for field in dataclasses.fields(Settings) if field.name != "data_dir"
}
IMAGE = dict(part.split("=", 1) for part in shlex.split(last("ENV")))


def fill(text: str, tls: str = "") -> str:
    """A value as compose gives it to the container."""
    text = text.replace("${SAGITTAL_TLS:-}", tls)
    return re.sub(r"\$\{[^}]*\}", DOMAIN, text)


def environment_of(name: str) -> dict[str, str]:
    """What a container of ours starts with; values must be texts, compose refuses others."""
    given = OURS[name]["environment"]
    assert all(isinstance(value, str) for value in given.values())
    return IMAGE | {key: fill(value) for key, value in given.items()}


def test_one_image_is_web_server_and_worker() -> None:
    assert set(OURS) == {*WEB, "worker"}
    assert all(service["build"] == "." for service in OURS.values())


@pytest.mark.parametrize("name", [*WEB, "worker"])
def test_every_setting_is_one_and_together_they_are_accepted(name: str) -> None:
    environment = environment_of(name)
    assert {key for key in environment if key.startswith("SAGITTAL_")} <= VARIABLES
    settings = load_settings(environment=environment)
    assert settings.hosts[-1] == DOMAIN
    assert settings.workers == 0
    assert any(ipaddress.ip_address("172.18.0.5") in ipaddress.ip_network(one) for one in settings.proxies)


@pytest.mark.parametrize("name", [*WEB, "worker"])
def test_every_command_exists(name: str) -> None:
    program, *words = OURS[name].get("command") or json.loads(last("CMD"))
    assert program == "sagittal"
    command, _, _ = make_app().parse_args(words, exit_on_error=False)
    assert command.__name__ == ("worker" if name == "worker" else "serve")


def test_every_volume_secret_and_service_that_is_named_is_declared_and_used() -> None:
    for kind in ("volumes", "secrets", "configs"):
        named = {
            one["source"] if isinstance(one, dict) else str(one).split(":")[0]
            for service in SERVICES.values()
            for one in service.get(kind, [])
            if not str(one).startswith("./")  # a folder beside the file
        }
        assert named == set(COMPOSE[kind])
    for service in SERVICES.values():
        assert set(service.get("depends_on", ())) <= set(SERVICES)


def test_the_database_is_the_one_that_the_url_and_the_password_file_name() -> None:
    url = make_url(environment_of("web-a")["SAGITTAL_DATABASE_URL"])
    made = SERVICES["database"]["environment"]
    assert (url.host, url.username, url.database) == ("database", made["POSTGRES_USER"], made["POSTGRES_DB"])
    assert url.password is None
    line = re.search(r"printf '(.*?):%s", TEXT)
    assert line is not None
    assert line[1] == f"{url.host}:5432:{url.database}:{url.username}"
    for path in (environment_of("web-a")["PGPASSFILE"], made["POSTGRES_PASSWORD_FILE"]):
        assert Path(path).parent == Path("/run/secrets")
        assert Path(path).name in COMPOSE["secrets"]


def test_the_image_has_the_database_driver_and_runs_on_a_disk_it_cannot_write() -> None:
    """What it writes is in volumes and in memory."""
    lock = (ROOT / "requirements.lock").read_text("utf-8")
    drivers = [Requirement(one).name for one in EXTRAS["postgres"]]
    assert all(re.search(rf"^{name}==", lock, re.MULTILINE) for name in drivers)
    for service in OURS.values():
        assert service["read_only"] is True
        writable = [*service["tmpfs"], *(one.split(":")[1] for one in service["volumes"])]
        for path in ("/tmp", IMAGE["SAGITTAL_HOME"], IMAGE["XDG_CACHE_HOME"]):  # noqa: S108
            assert any(Path(path).is_relative_to(one) for one in writable), path


def test_the_proxy_reaches_the_port_on_which_the_server_listens() -> None:
    caddyfile = fill(COMPOSE["configs"]["caddyfile"]["content"])
    assert caddyfile.split()[0] == DOMAIN
    found = re.search(r"reverse_proxy (.*) \{", caddyfile)
    assert found is not None
    reached = [one.partition(":") for one in found[1].split()]
    assert [host for host, _, _ in reached] == list(WEB)
    for host, _, port in reached:
        settings = load_settings(environment=environment_of(host))
        assert (settings.host, str(settings.port)) == ("0.0.0.0", port)  # noqa: S104
        assert port == last("EXPOSE")


CHOICES = {
    "": [],
    "tls internal": ["tls", "internal"],
    "tls /tls/gait.crt /tls/gait.key": ["tls", "/tls/gait.crt", "/tls/gait.key"],
}


@pytest.mark.parametrize("tls", CHOICES)
def test_the_proxy_takes_a_certificate_of_the_intranet(tls: str) -> None:
    site = [line.split() for line in fill(COMPOSE["configs"]["caddyfile"]["content"], tls).splitlines()]
    assert [words for words in site if words and words[0] == "tls"] == ([CHOICES[tls]] if tls else [])
    assert site.index([DOMAIN, "{"]) == 0
    if tls.endswith(".key"):
        [mounted] = [one.split(":") for one in SERVICES["proxy"]["volumes"] if one.startswith("./")]
        assert mounted[1:] == [str(Path(CHOICES[tls][1]).parent), "ro"]
    assert not tls or f'SAGITTAL_TLS="{tls}"' in TEXT


@pytest.mark.anyio
async def test_the_health_check_of_the_proxy_is_answered(tmp_path: Path) -> None:
    """With the host that the proxy sends; the name of the service alone is none of the allowed ones."""
    caddyfile = fill(COMPOSE["configs"]["caddyfile"]["content"])
    [uri] = re.findall(r"health_uri (\S+)", caddyfile)
    [host] = re.findall(r"health_headers {\s+Host (\S+)\s+}", caddyfile)
    settings = load_settings(environment=environment_of("web-a"))
    async with open_clinic(tmp_path, allowed_hosts=settings.allowed_hosts, behind_tls=True) as clinic:
        async with clinic.client(headers={"Host": host}) as client:
            assert (await client.get(uri)).status_code == 200
        async with clinic.client(headers={"Host": "web-a:8000"}) as client:
            assert (await client.get(uri)).status_code == 400


def test_containers_of_ours_have_no_privileges_and_all_logs_have_an_end() -> None:
    for service in OURS.values():
        assert service["cap_drop"] == ["ALL"]
        assert "no-new-privileges:true" in service["security_opt"]
    for service in SERVICES.values():
        assert {"max-size", "max-file"} <= service["logging"]["options"].keys()


def test_each_web_server_has_a_name_of_its_own_and_the_address_of_its_service() -> None:
    nodes = {name: load_settings(environment=environment_of(name)) for name in WEB}
    assert len({settings.node_name for settings in nodes.values()}) == len(WEB)
    for name, settings in nodes.items():
        assert settings.node_address == f"http://{name}:{settings.port}"
        assert not load_settings(environment=environment_of("worker")).node_name


def test_the_server_has_time_to_end() -> None:
    """Within ten seconds, which is all that docker gives unless it is told."""
    assert all(int(service["stop_grace_period"].removesuffix("s")) > 10 for service in OURS.values())


def test_what_the_image_copies_is_there() -> None:
    copied = [value for key, value in INSTRUCTIONS if key == "COPY" and not value.startswith("--from")]
    for value in copied:
        *sources, _ = value.split()
        assert all((ROOT / source).exists() for source in sources), value
