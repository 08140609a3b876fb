"""One's own account."""

from __future__ import annotations

import pytest

from sagittal.server.auth import api_tokens
from sagittal.server.auth.api_tokens import MOST_DAYS, Scope
from sagittal.server.auth.passwords import MIN_LENGTH
from sagittal.server.pages.account.account import SCOPE_WORDS
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


async def test_the_page_has_ones_own_tokens_and_every_right_a_token_can_have(clinic: Clinic) -> None:
    assert set(SCOPE_WORDS) == set(Scope)
    for name in ("viewer", "clinician"):
        user = clinic.user(name)
        with clinic.db.write() as c:
            api_tokens.issue(c, user, f"Program of the {name}", [Scope.READ], 3)
    async with clinic.client("viewer") as client:
        page = (await client.get("/account")).text
    assert "Program of the viewer" in page
    assert "Program of the clinician" not in page
    assert all(words in page for words in SCOPE_WORDS.values())
    assert f'minlength="{MIN_LENGTH}"' in page
    assert f'max="{MOST_DAYS}"' in page
    async with clinic.client() as client:
        door = await client.get("/account", headers={"accept": "text/html"})
    assert (door.status_code, door.headers["location"].partition("?")[0]) == (303, "/sign-in")
