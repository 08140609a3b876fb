"""One's own security keys over the API: what each change asks for."""

from __future__ import annotations

import httpx
import pyotp
import pytest

from sagittal.server.auth import second_factor
from sagittal.server.auth.throttle import Throttle
from tests.helpers.clinic import PASSWORD, Clinic
from tests.server.auth.soft_key import SoftKey

pytestmark = pytest.mark.anyio
ACCOUNT, HERE = "/api/v1/account", "http://localhost"


async def test_a_key_is_added_listed_and_removed_with_password_and_code(clinic: Clinic) -> None:
    clinic.app.state.throttle = Throttle()
    user, key_file = clinic.user("clinician"), clinic.settings.second_factor_key
    with clinic.db.write() as c:
        session = second_factor.begin(c, key_file, user, "clinician")
        codes = second_factor.confirm(c, key_file, user, pyotp.TOTP(session.secret).now())
    async with clinic.client(headers={"Cookie": f"sid={clinic.token('clinician')}"}) as client:
        client.base_url = httpx.URL(HERE)

        async def ask(method: str, path: str, **body: object) -> tuple[int, str]:
            answer = await client.request(method, ACCOUNT + path, json=body)
            return answer.status_code, answer.json().get("code", "") if answer.content else ""

        def both() -> dict[str, object]:
            return {"password": PASSWORD, "code": codes.pop()}

        options = "/security-keys/options"
        assert await ask("POST", options, password="wrong", code=codes[-1]) == (403, "wrong_password")
        assert await ask("POST", options, password=PASSWORD, code="000000") == (403, "wrong_code")
        assert await ask("PUT", "/second-factor/keys-only", on=True, **both()) == (409, "no_key")
        assert await ask("PUT", "/second-factor/keys-only", on=False, **both()) == (204, "")
        requested_body = (await client.post(ACCOUNT + options, json=both())).json()["options"]
        key = SoftKey()
        body = {"name": " blue ", "key": key.create(requested_body, HERE)}
        added = await client.post(f"{ACCOUNT}/security-keys", json=body)
        assert added.status_code == 201, added.text
        assert (added.json()["name"], added.json()["host"], added.json()["used_at"]) == (
            "blue",
            "localhost",
            None,
        )
        second_response = await client.post(f"{ACCOUNT}/security-keys", json=body)
        assert (second_response.status_code, second_response.json()["code"]) == (
            403,
            "key_refused",
        )  # answered once
        assert (await client.get(f"{ACCOUNT}/security-keys")).json() == [added.json()]
        assert await ask("PUT", "/second-factor/keys-only", on=True, **both()) == (204, "")
        with clinic.db.read() as c:
            assert second_factor.takes_keys_only(c, user)
        assert await ask("PUT", "/second-factor/keys-only", on=False, **both()) == (204, "")
        path = f"/security-keys/{added.json()['id']}/remove"
        assert await ask("POST", path, password=PASSWORD, code="000000") == (403, "wrong_code")
        assert await ask("POST", path, **both()) == (204, "")
        assert (await ask("POST", path, **both()))[0] == 404
        assert (await client.get(f"{ACCOUNT}/security-keys")).json() == []
    async with clinic.client("admin") as admin:
        rows = (await admin.get("/api/v1/audit")).json()
    done = [
        r["action"] for r in rows if r["action"].startswith(("user.security_key", "user.keys", "user.codes"))
    ]
    assert done == [
        "user.security_key_removed", "user.codes_again", "user.keys_only",
        "user.security_key_refused", "user.security_key_added", "user.codes_again",
    ]  # fmt: skip
