"""Accounts, for administrators."""

from __future__ import annotations

from pathlib import Path

import pytest
from sqlalchemy import func, select

from sagittal.server.auth import accounts
from sagittal.server.auth.roles import Role
from sagittal.server.storage.schema.tables import login_session
from tests.helpers.clinic import PASSWORD, Clinic, open_clinic
from tests.helpers.engines import on_both_engines

pytestmark = [pytest.mark.anyio, on_both_engines]


async def test_a_closed_account_and_a_new_role_end_all_sign_ins(clinic: Clinic) -> None:
    user = clinic.user("assistant", "cleo")
    token = clinic.token("assistant", "cleo")
    async with clinic.client("admin") as client:
        answer = await client.patch(f"/api/v1/users/{user}", json={"role": "clinician"})
        assert answer.json()["role"] == "clinician"
        assert clinic.app.state.logins.find(token) is None
        token = clinic.token("assistant", "cleo")
        assert (await client.patch(f"/api/v1/users/{user}", json={"active": False})).status_code == 200
        assert clinic.app.state.logins.find(token) is None
    async with clinic.client() as client:
        answer = await client.post("/api/v1/sign-in", json={"name": "cleo", "password": PASSWORD})
    assert answer.json()["code"] == "wrong_password"


async def test_the_last_administrator_cannot_be_lost(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic:
        admin = clinic.user("admin")
        async with clinic.client("admin") as client:
            for change in ({"role": "viewer"}, {"active": False}):
                answer = await client.patch(f"/api/v1/users/{admin}", json=change)
                assert (answer.status_code, answer.json()["code"]) == (409, "last_administrator")
            response = await client.post(
                "/api/v1/users", json={"name": "admin", "role": "viewer", "password": PASSWORD}
            )
            assert (response.status_code, response.json()["code"]) == (409, "name_taken")
        with clinic.db.read() as c:
            assert accounts.get(c, admin).role == Role.ADMIN
            assert c.execute(select(func.count()).select_from(login_session)).scalar_one() == 1


async def test_accounts_are_added_changed_and_listed_without_a_trace_of_the_password(clinic: Clinic) -> None:
    new = {"name": "frieda", "role": "viewer", "password": PASSWORD}
    async with clinic.client("admin") as client:
        response = await client.post("/api/v1/users", json=new)
        assert response.status_code == 201
        user = response.json()
        assert set(user) == {"id", "name", "display_name", "role", "active", "created_at"}
        assert (user["name"], user["role"], user["active"]) == ("frieda", "viewer", True)
        changed = await client.patch(f"/api/v1/users/{user['id']}", json={"display_name": "Frieda F."})
        assert changed.json() == user | {"display_name": "Frieda F."}
        listed = (await client.get("/api/v1/users")).json()
        assert [u["name"] for u in listed] == sorted(u["name"] for u in listed)
        assert changed.json() in listed
        refused = await client.delete(f"/api/v1/users/{user['id']}/second-factor")
        assert (refused.status_code, refused.json()["code"]) == (404, "second_factor_off")
        nobody = await client.patch(f"/api/v1/users/{'0' * 32}", json={"active": False})
        assert nobody.status_code == 404
        rows = [r for r in (await client.get("/api/v1/audit")).json() if r["resource_id"] == user["id"]]
    assert [(r["action"], r["detail"]) for r in rows] == [
        ("user.changed", {"fields": ["display_name"], "role": "viewer"}),
        ("user.created", {"role": "viewer"}),
    ]
    async with clinic.client("clinician") as client:
        assert (await client.get("/api/v1/users")).status_code == 403


async def test_a_new_password_ends_sign_ins_and_closing_keeps_those_of_the_administrator(
    clinic: Clinic,
) -> None:
    person = clinic.user("viewer", "gerda")
    token = clinic.token("viewer", "gerda")
    async with clinic.client("admin") as client:
        path = f"/api/v1/users/{person}"
        assert (await client.patch(path, json={"display_name": "Gerda"})).status_code == 200
        assert clinic.app.state.logins.find(token) is not None
        assert (await client.patch(path, json={"password": "a password of hers"})).status_code == 200
        assert clinic.app.state.logins.find(token) is None
        mine = f"/api/v1/users/{clinic.user('admin')}"
        assert (await client.patch(mine, json={"password": PASSWORD})).status_code == 200
        assert (await client.get("/api/v1/account")).status_code == 200
