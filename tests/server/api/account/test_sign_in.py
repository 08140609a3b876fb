"""Signing in by name and password, by an address that works once, and one's own password."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

from sagittal.server.auth import accounts, one_time
from sagittal.server.auth.roles import POLICY, Role
from sagittal.server.auth.throttle import MAX_PER_PAIR, Throttle
from sagittal.server.storage.schema.tables import one_time_token
from tests.helpers.clinic import PASSWORD, Clinic, open_clinic
from tests.helpers.engines import on_both_engines

pytestmark = [pytest.mark.anyio, on_both_engines]


async def test_unknown_names_and_wrong_passwords_get_the_same_answer(clinic: Clinic) -> None:
    clinic.user("viewer")
    async with clinic.client() as client:
        answers = [
            await client.post("/api/v1/sign-in", json={"name": name, "password": "wrong password"})
            for name in ("viewer", "nobody")
        ]
    assert answers[0].status_code == 401
    assert answers[0].json() == answers[1].json()


async def test_guessing_a_password_is_stopped_and_says_when_to_try_again(clinic: Clinic) -> None:
    clinic.app.state.throttle = Throttle()
    clinic.user("viewer", "dora")
    async with clinic.client() as client:
        answers = [
            await client.post("/api/v1/sign-in", json={"name": "dora", "password": f"guess number {i}"})
            for i in range(MAX_PER_PAIR + 1)
        ]
        right = await client.post("/api/v1/sign-in", json={"name": "dora", "password": PASSWORD})
    assert [a.status_code for a in answers] == [401] * MAX_PER_PAIR + [429]
    assert right.status_code == 429
    assert int(right.headers["retry-after"]) > 0
    async with clinic.client("admin") as admin:
        users = (await admin.get("/api/v1/users")).json()
        dora = next(u["id"] for u in users if u["name"] == "dora")
        new = {"password": "a password that is new"}
        assert (await admin.patch(f"/api/v1/users/{dora}", json=new)).status_code == 200
    async with clinic.client() as client:
        opened = await client.post("/api/v1/sign-in", json={"name": "dora"} | new)
    assert opened.status_code == 200
    clinic.app.state.throttle = Throttle()


async def test_a_form_signs_in_without_scripts_and_never_leads_elsewhere(clinic: Clinic) -> None:
    clinic.user("viewer")
    for expected, got in (
        ("/jobs", "/jobs"),
        ("//evil.example", "/patients"),
        ("https://evil.example", "/patients"),
    ):
        async with clinic.client() as client:
            form = {"name": "viewer", "password": PASSWORD, "next": expected}
            answer = await client.post("/api/v1/sign-in", data=form)
        assert answer.status_code == 303
        assert answer.headers["location"] == got
        assert answer.cookies["sid"]


async def test_set_up_makes_the_first_administrator_once(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic:
        with clinic.db.write() as c:
            first = one_time.issue_set_up(c)
            token = one_time.issue_set_up(c)
        body = {"name": "anna", "password": PASSWORD}
        async with clinic.client() as client:
            for wrong in (first, "x", "%00"):
                assert (await client.post(f"/api/v1/set-up/{wrong}", json=body)).status_code == 404
            answer = await client.post(f"/api/v1/set-up/{token}", json=body)
            assert answer.status_code == 201
            account = (await client.get("/api/v1/account")).json()
            assert (account["name"], account["role"]) == ("anna", "admin")
            second_response = await client.post(f"/api/v1/set-up/{token}", json=body)
            assert (second_response.status_code, second_response.json()["code"]) == (404, "link_not_valid")
            assert (await client.post("/api/v1/sign-in", json=body)).status_code == 200
        with clinic.db.write() as c:
            second = one_time.issue_set_up(c)
            assert not one_time.is_valid(c, second, "set_up")


async def test_web_servers_with_a_shared_key_issue_one_set_up_address(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with open_clinic(tmp_path) as clinic:

        def issue(key: bytes) -> str:
            with clinic.db.write() as c:
                return one_time.issue_set_up(c, key)

        token = issue(b"key of both")
        assert issue(b"key of both") == token
        second = issue(b"another key")
        assert second != token
        with clinic.db.read() as c:
            assert not one_time.is_valid(c, token, "set_up")
            assert one_time.is_valid(c, second, "set_up")
        monkeypatch.setattr(one_time, "LIFE", dt.timedelta(seconds=-1))
        expired = issue(b"key of both")
        assert issue(b"key of both") != expired


async def test_a_one_time_address_signs_in_once(clinic: Clinic) -> None:
    admin = clinic.user("admin")
    with clinic.db.write() as c:
        token = one_time.issue_sign_in(c, admin)
        assert not one_time.is_valid(c, token, "set_up")
    async with clinic.client() as client:
        answer = await client.get(f"/sign-in/{token}")
        assert (answer.status_code, answer.headers["location"]) == (303, "/patients")
        assert (await client.get("/api/v1/account")).json()["name"] == "admin"
    async with clinic.client() as client:
        assert (await client.get(f"/sign-in/{token}")).status_code == 404


async def test_a_one_time_address_expires(clinic: Clinic) -> None:
    admin = clinic.user("admin")
    with clinic.db.write() as c:
        token = one_time.issue_sign_in(c, admin)
        c.execute(one_time_token.update().values(expires_at=dt.datetime(2020, 1, 1, tzinfo=dt.UTC)))
    async with clinic.client() as client:
        assert (await client.get(f"/sign-in/{token}")).status_code == 404


async def test_changing_the_password_needs_the_present_one_and_ends_other_sign_ins(clinic: Clinic) -> None:
    clinic.user("admin")  # without one no account may change
    clinic.user("viewer", "edda")
    second = clinic.token("viewer", "edda")
    mine = clinic.token("viewer", "edda")
    async with clinic.client(headers={"Cookie": f"sid={mine}"}) as client:
        path = "/api/v1/account/password"
        wrong = await client.post(path, json={"current": "not my password", "password": "another good one"})
        assert (wrong.status_code, wrong.json()["code"]) == (403, "wrong_password")
        right = await client.post(path, json={"current": PASSWORD, "password": "another good one"})
        assert right.status_code == 204
        assert (await client.get("/api/v1/account")).status_code == 200
    assert clinic.app.state.logins.find(second) is None


async def test_who_is_signed_in_is_told_what_this_person_may_do(clinic: Clinic) -> None:
    clinic.user("admin")  # without one no account may change
    async with clinic.client("assistant") as client:
        account = (await client.get("/api/v1/account")).json()
        assert (account["id"], account["name"], account["role"]) == (
            clinic.user("assistant"),
            "assistant",
            "assistant",
        )
        assert account["actions"] == sorted(a.value for a, user in POLICY.items() if Role.ASSISTANT in user)
        for language, status in (("de", 204), (None, 204), ("fr", 422)):
            chosen = await client.put("/api/v1/account/language", json={"language": language})
            assert chosen.status_code == status, language
            with clinic.db.read() as c:
                assert accounts.get(c, account["id"]).language == (language if status == 204 else None)


async def test_what_is_no_form_and_no_json_is_refused_by_its_field(clinic: Clinic) -> None:
    async with clinic.client() as client:
        for body, field in (
            (b"{", "double quotes"),
            (b'{"name": "viewer"}', "password"),
            (b'{"name": "viewer", "password": "x", "pin": 1}', "pin"),
        ):
            refused = await client.post(
                "/api/v1/sign-in", content=body, headers={"content-type": "application/json"}
            )
            assert (refused.status_code, refused.json()["code"]) == (422, "invalid_request")
            assert field in refused.text
        assert not client.cookies
