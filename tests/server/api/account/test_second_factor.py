"""One's own second factor over the API: it holds from the first right code on."""

from __future__ import annotations

import pyotp
import pytest

from sagittal.server.auth.throttle import Throttle
from tests.helpers.clinic import PASSWORD, Clinic

pytestmark = pytest.mark.anyio
HERE = "/api/v1/account/second-factor"


async def test_it_is_set_up_proved_and_removed_with_a_code(clinic: Clinic) -> None:
    clinic.app.state.throttle = Throttle()
    async with clinic.client("clinician") as client:

        async def ask(path: str, **body: str) -> tuple[int, str]:
            answer = await client.post(HERE + path, json=body)
            return answer.status_code, answer.json()["code"] if answer.content else ""

        assert await ask("", password="wrong") == (403, "wrong_password")
        assert await ask("/remove", code="123456") == (403, "wrong_code")
        payload = (await client.post(HERE, json={"password": PASSWORD})).json()
        assert set(payload) == {"secret", "address", "picture"}
        # not proved yet: nobody is asked for it
        async with clinic.client() as other_client:
            person = {"name": "clinician", "password": PASSWORD}
            assert (await other_client.post("/api/v1/sign-in", json=person)).status_code == 200
        assert await ask("/confirm", code="000000") == (403, "wrong_code")
        proved = await client.post(f"{HERE}/confirm", json={"code": pyotp.TOTP(payload["secret"]).now()})
        codes = proved.json()["codes"].split("\n")
        assert (proved.status_code, len(codes)) == (200, 10)
        async with clinic.client() as other_client:
            requested_response = await other_client.post("/api/v1/sign-in", json=person)
            assert (requested_response.status_code, requested_response.json()["code"]) == (401, "code_needed")
        assert (await ask("", password=PASSWORD))[0] == 409
        assert await ask("/remove", code="000000") == (403, "wrong_code")
        assert await ask("/remove", code=codes[0]) == (204, "")
        assert await ask("/remove", code=codes[1]) == (403, "wrong_code")
    async with clinic.client("admin") as admin:
        rows = (await admin.get("/api/v1/audit")).json()
    done = [r["action"] for r in rows if r["action"].startswith("user.second_factor")]
    assert done == ["user.second_factor_off", "user.second_factor_on"]
