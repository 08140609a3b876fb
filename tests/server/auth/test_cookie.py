"""The session cookie: its name and attributes say where it is given out."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.helpers.clinic import PASSWORD, Clinic, open_clinic
from tests.helpers.engines import on_both_engines

pytestmark = [pytest.mark.anyio, on_both_engines]


async def test_the_cookie_is_secure_and_bound_to_the_host_behind_tls(tmp_path: Path) -> None:
    async with open_clinic(tmp_path, behind_tls=True, allowed_hosts=("gait.example",)) as clinic:
        clinic.user("viewer")
        async with clinic.client() as client:
            answer = await client.post(
                "https://gait.example/api/v1/sign-in", json={"name": "viewer", "password": PASSWORD}
            )
        cookie = answer.headers["set-cookie"]
        assert cookie.startswith("__Host-sid=")
        for attribute in ("Secure", "HttpOnly", "Path=/", "SameSite=lax"):
            assert attribute in cookie
        assert "Domain" not in cookie
        # a plain cookie could have been planted by another service of the same host
        async with clinic.client("viewer") as client:
            assert (await client.get("https://gait.example/api/v1/account")).status_code == 401


async def test_on_loopback_the_cookie_has_its_plain_name_and_is_taken_back_alike(clinic: Clinic) -> None:
    clinic.user("viewer")
    async with clinic.client() as client:
        post = await client.post("/api/v1/sign-in", json={"name": "viewer", "password": PASSWORD})
        token = post.cookies["sid"]
        assert post.headers["set-cookie"] == f"sid={token}; HttpOnly; Path=/; SameSite=lax"
        response = await client.post("/api/v1/sign-out")
    headers = response.headers["set-cookie"]
    assert headers.startswith('sid=""; ')
    assert {"Max-Age=0", "HttpOnly", "Path=/", "SameSite=lax"} <= set(headers.split("; "))
    # the name for TLS is no way in here
    async with clinic.client(headers={"Cookie": f"__Host-sid={clinic.token('viewer')}"}) as client:
        assert (await client.get("/api/v1/account")).status_code == 401
