"""One's own tokens for programs: made with one's password, shown once, ended at once."""

from __future__ import annotations

import datetime as dt

import pytest

from sagittal.server.auth.throttle import Throttle
from tests.helpers.clinic import PASSWORD, Clinic

pytestmark = pytest.mark.anyio
TOKENS = "/api/v1/account/tokens"
BODY = {"name": "Matlab", "scopes": ["read", "upload"], "days": 7, "password": PASSWORD}


async def test_a_token_is_shown_once_and_listed_to_its_owner_alone(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        response = await client.post(TOKENS, json=BODY)
        assert response.status_code == 201, response.text
        token = response.json()
        assert token.pop("token").startswith("sgt_")
        assert (token["name"], sorted(token["scopes"]), token["used_at"]) == (
            "Matlab",
            ["read", "upload"],
            None,
        )
        begins, ends = (dt.datetime.fromisoformat(token[k]) for k in ("created_at", "expires_at"))
        assert ends - begins == dt.timedelta(days=7)
        newer = (await client.post(TOKENS, json=BODY | {"name": "R"})).json()
        assert [t["name"] for t in (await client.get(TOKENS)).json()] == ["R", "Matlab"]
        assert (await client.get(TOKENS)).json()[1] == token
    async with clinic.client("viewer") as other_client:
        assert (await other_client.get(TOKENS)).json() == []
        assert (await other_client.delete(f"{TOKENS}/{token['id']}")).status_code == 404
    async with clinic.client("clinician") as client:
        assert (await client.delete(f"{TOKENS}/{token['id']}")).status_code == 204
        assert [t["id"] for t in (await client.get(TOKENS)).json()] == [newer["id"]]
    async with clinic.client("admin") as client:
        rows = [r for r in (await client.get("/api/v1/audit")).json() if r["resource_id"] == token["id"]]
    assert [(r["action"], r["user_name"]) for r in rows] == [
        ("token.revoked", "clinician"),
        ("token.made", "clinician"),
    ]
    assert rows[1]["detail"] == {"scopes": token["scopes"], "days": 7}


async def test_without_the_password_there_is_no_token(clinic: Clinic) -> None:
    clinic.app.state.throttle = Throttle()
    async with clinic.client("assistant") as client:
        refused = await client.post(TOKENS, json=BODY | {"password": "wrong"})
        assert (refused.status_code, refused.json()["code"]) == (403, "wrong_password")
        assert (await client.get(TOKENS)).json() == []
