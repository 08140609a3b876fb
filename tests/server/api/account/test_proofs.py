"""What asks for the password again: every such route refuses a wrong one alike, and changes nothing."""

from __future__ import annotations

from typing import Any

import pytest

from sagittal.server.auth.throttle import Throttle
from tests.helpers.clinic import PASSWORD, Clinic

pytestmark = pytest.mark.anyio
ACCOUNT = "/api/v1/account"
BOTH = {"password": "wrong", "code": "000000"}
NEW = "a new and long password"

ASKED: list[tuple[str, str, dict[str, Any]]] = [
    ("POST", "/security-keys/options", BOTH),
    ("POST", f"/security-keys/{'a' * 32}/remove", BOTH),
    ("PUT", "/second-factor/keys-only", {**BOTH, "on": False}),
    ("POST", "/second-factor", {"password": "wrong"}),
    ("POST", "/tokens", {"password": "wrong", "name": "a program", "scopes": ["read"], "days": 1}),
    ("POST", "/password", {"current": "wrong", "password": NEW}),
]


@pytest.mark.parametrize(("method", "path", "body"), ASKED)
async def test_a_wrong_password_is_refused_and_written_down(
    clinic: Clinic, method: str, path: str, body: dict[str, Any]
) -> None:
    clinic.app.state.throttle = Throttle()
    async with clinic.client("clinician") as client:
        answer = await client.request(method, ACCOUNT + path, json=body)
        assert (answer.status_code, answer.json()["code"]) == (403, "wrong_password")
    async with clinic.client("admin") as admin:
        newest = (await admin.get("/api/v1/audit")).json()[0]
    assert (newest["action"], newest["resource_id"]) == ("sign_in.failed", clinic.user("clinician"))


async def test_without_a_second_factor_the_password_alone_proves_it(clinic: Clinic) -> None:
    clinic.app.state.throttle = Throttle()
    async with clinic.client("clinician") as client:
        body = {"password": PASSWORD, "code": "000000"}
        answer = await client.post(f"{ACCOUNT}/security-keys/{'a' * 32}/remove", json=body)
    assert answer.status_code == 404
