"""The page of accounts."""

from __future__ import annotations

import pyotp
import pytest

from sagittal.server.auth import second_factor
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.passwords import MIN_LENGTH
from sagittal.server.auth.roles import Role
from sagittal.server.pages.words import ROLE_WORDS
from sagittal.server.sharing import care_teams
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


async def test_accounts_stand_with_role_and_second_factor_for_administrators_alone(clinic: Clinic) -> None:
    person, key = clinic.user("assistant", "hanna"), clinic.settings.second_factor_key
    identity = Identity(clinic.user("admin"), "admin", "", Role.ADMIN, "")
    async with clinic.client("admin") as client:
        initial_text = (await client.get("/users")).text
        with clinic.db.write() as c:
            session = second_factor.begin(c, key, person, "hanna")
            second_factor.confirm(c, key, person, pyotp.TOTP(session.secret).now())
            care_teams.switch_on(c, identity, begin_with_past=False)
        final_text = (await client.get("/users")).text
    assert "hanna" in initial_text
    assert all(words in initial_text for words in ROLE_WORDS.values())
    assert f'minlength="{MIN_LENGTH}"' in initial_text
    assert initial_text.count("Remove second factor") == 0
    assert f"/api/v1/users/{person}/second-factor" in final_text
    assert initial_text != final_text
    async with clinic.client("clinician") as client:
        assert (await client.get("/users")).status_code == 403
