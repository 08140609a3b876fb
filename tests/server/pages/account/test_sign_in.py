"""Pages without sign-in."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sagittal.server.auth import one_time
from sagittal.server.auth.passwords import MIN_LENGTH
from tests.helpers.clinic import Clinic, open_clinic

pytestmark = pytest.mark.anyio


async def test_the_first_account_is_requested_at_a_valid_address_only(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic:  # one without accounts
        with clinic.db.write() as c:
            token = one_time.issue_set_up(c)
        async with clinic.client() as client:
            valid, guessed = await client.get(f"/set-up/{token}"), await client.get("/set-up/guessed")
    assert valid.status_code == 200
    assert f"/api/v1/set-up/{token}" in valid.text
    assert f'minlength="{MIN_LENGTH}"' in valid.text
    assert guessed.status_code == 404
    assert "<form" not in guessed.text


@pytest.mark.parametrize(
    ("asked", "led"),
    [
        ("", "/patients"),
        ("?next=/jobs", "/jobs"),
        ("?next=//evil.example", "/patients"),
        ("?next=/%5Cevil.example", "/patients"),
        ("?next=/%09/evil.example", "/patients"),
        ("?next=/%0A/evil.example", "/patients"),
    ],
)
async def test_the_form_leads_on_to_a_page_of_this_server_only(clinic: Clinic, asked: str, led: str) -> None:
    async with clinic.client() as client:
        page = await client.get(f"/sign-in{asked}")
    assert page.status_code == 200
    assert re.findall(r'data-then="([^"]*)"', page.text) == [led]
    assert "evil" not in page.text


async def test_the_front_door_leads_to_the_patients_or_to_the_form(clinic: Clinic) -> None:
    async with clinic.client("viewer") as client:
        home = await client.get("/")
        assert (home.status_code, home.headers["location"]) == (303, "/patients")
    async with clinic.client() as client:
        door = await client.get("/", headers={"accept": "text/html"})
        assert (door.status_code, door.headers["location"].partition("?")[0]) == (303, "/sign-in")
