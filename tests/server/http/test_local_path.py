from __future__ import annotations

import pytest

from sagittal.server.http.local_path import local_path


@pytest.mark.parametrize("path", ["/", "/patients", "/jobs?state=done#last", "/patients/a//b", "/Prüfung"])
def test_a_path_of_this_server_is_kept(path: str) -> None:
    assert local_path(path) == path


@pytest.mark.parametrize(
    "path",
    [
        None,
        "",
        "jobs",
        "https://evil.example",
        "//evil.example",
        "/\\evil.example",
        "/\t/evil.example",  # browsers drop the tab and the line's end, and read //
        "/\n/evil.example",
        "/jobs\r",
    ],
)
def test_anything_else_leads_to_the_patients(path: str | None) -> None:
    assert local_path(path) == "/patients"
