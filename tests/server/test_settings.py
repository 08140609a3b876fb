from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sagittal.server.settings import Settings, SettingsError, load_settings

EVERYWHERE = "0.0.0.0"  # noqa: S104 - never bound here


def test_command_line_goes_before_environment_before_defaults() -> None:
    env = {"SAGITTAL_HOME": "/data", "SAGITTAL_PORT": "9000", "SAGITTAL_ALLOWED_HOSTS": "gait.clinic, b"}
    settings = load_settings({"port": 9001, "host": None}, env)
    assert settings.data_dir == Path("/data")
    assert (settings.port, settings.host, settings.workers) == (9001, "127.0.0.1", 1)
    assert settings.hosts[-2:] == ("gait.clinic", "b")


def test_settings_survive_the_way_to_a_child_process(tmp_path: Path) -> None:
    settings = Settings(
        data_dir=tmp_path, lease_s=1.5, behind_tls=True, host=EVERYWHERE, allowed_hosts=("a", "b")
    )
    assert load_settings(None, settings.environment()) == settings


@pytest.mark.parametrize(
    ("given", "env", "words"),
    [
        ({"port": 70000}, {}, "port is 70000"),
        ({}, {"SAGITTAL_WORKERS": "two"}, "SAGITTAL_WORKERS is 'two'"),
        ({}, {"SAGITTAL_LEASE_S": "0"}, "lease_s is 0"),
        ({}, {"SAGITTAL_BEHIND_TLS": "maybe"}, "SAGITTAL_BEHIND_TLS"),
        (
            {},
            {"SAGITTAL_TRUSTED_PROXIES": "10.0.0.1,nginx"},
            "trusted_proxies is 'nginx', expected",
        ),
        ({}, {"SAGITTAL_TRUSTED_PROXIES": "0.0.0.0/0"}, "not all of the internet"),
        ({}, {"SAGITTAL_MAX_CONNECTIONS": "0"}, "max_connections is 0"),
    ],
)
def test_a_wrong_setting_is_named(given: dict[str, object], env: dict[str, str], words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        load_settings(given, env)


def test_only_an_open_bind_without_tls_is_refused() -> None:
    with pytest.raises(SettingsError, match="unencrypted"):
        Settings(host=EVERYWHERE).require_private_traffic()
    for settings in (Settings(), Settings(host="::1"), Settings(host=EVERYWHERE, behind_tls=True)):
        settings.require_private_traffic()


@pytest.mark.parametrize(
    ("given", "address"),
    [
        ({}, "http://127.0.0.1:8123"),
        ({"host": "::1"}, "http://[::1]:8123"),
        ({"host": EVERYWHERE, "behind_tls": True}, "http://localhost:8123"),
        ({"host": "::", "behind_tls": True}, "http://localhost:8123"),
        (
            {"host": EVERYWHERE, "behind_tls": True, "allowed_hosts": ("gait.clinic.example", "b")},
            "https://gait.clinic.example",
        ),
        (
            {"behind_tls": True, "allowed_hosts": ("gait.clinic.example:8443",)},
            "https://gait.clinic.example:8443",
        ),
        ({"allowed_hosts": ("gait.clinic.example",)}, "http://127.0.0.1:8123"),
    ],
)
def test_the_public_address_names_a_host_that_a_browser_reaches(given: dict[str, Any], address: str) -> None:
    assert Settings(**given).make_public_address(8123) == address
