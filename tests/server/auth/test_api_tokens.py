"""Tokens of programs: a part of a person's rights, for a time, shown once."""

from __future__ import annotations

import datetime as dt
import re
from typing import Any

import httpx
import pytest
from sqlalchemy import select, update

from sagittal.server.auth.api_tokens import SCOPES, Scope
from sagittal.server.auth.roles import POLICY, Action
from sagittal.server.storage.schema.person_tables import api_token
from sagittal.server.storage.schema.tables import audit, now
from tests.helpers.clinic import PASSWORD, Clinic
from tests.helpers.marks import sqlite_only

pytestmark = pytest.mark.anyio
API = "/api/v1"


async def make(clinic: Clinic, role: str, *scopes: str, days: int = 5) -> dict[str, Any]:
    async with clinic.client(role) as client:
        body = {"name": "Matlab", "scopes": scopes, "days": days, "password": PASSWORD}
        answer = await client.post(f"{API}/account/tokens", json=body)
        assert answer.status_code == 201, answer.text
        fields: dict[str, Any] = answer.json()
        return fields


def bearer(clinic: Clinic, token: str) -> httpx.AsyncClient:
    return clinic.client(headers={"authorization": f"Bearer {token}"})


async def test_a_token_does_what_its_scopes_and_its_person_may(clinic: Clinic) -> None:
    recording = await make(clinic, "clinician", "read")
    async with bearer(clinic, recording["token"]) as client:
        assert (await client.get(f"{API}/patients")).status_code == 200
        assert (await client.post(f"{API}/patients", json={"code": "TK-1"})).status_code == 403
        for path in ("/account", "/account/tokens", "/audit", "/users"):
            assert (await client.get(API + path)).status_code == 403
        # its door is the API: no page, no cookie, no address
        assert (await client.get("/patients", headers={"accept": "text/html"})).status_code == 303
    async with clinic.client() as client:
        client.cookies.set("sid", recording["token"])
        assert (await client.get(f"{API}/patients")).status_code == 401
        assert (await client.get(f"{API}/patients?token={recording['token']}")).status_code == 401
    writer = await make(clinic, "clinician", "write", "read")
    async with bearer(clinic, writer["token"]) as client:
        made_patient = await client.post(f"{API}/patients", json={"code": "TK-2"})
        assert made_patient.status_code == 201
        path = f"{API}/patients/{made_patient.json()['id']}"
        gone = await client.request("DELETE", path, json={"confirm": "TK-2"})
        assert gone.status_code == 403
        visit = (await client.post(f"{path}/sessions", json={"title": "Walk"})).json()["id"]
        assert (await client.patch(f"{API}/sessions/{visit}", json={"title": "Run"})).status_code == 200
        assert (await client.delete(f"{API}/sessions/{visit}")).status_code == 403
    with clinic.db.read() as c:
        row = c.execute(select(audit).where(audit.c.action == "patient.created")).all()[-1]
    assert (row.user_name, row.detail["token"]) == ("clinician", writer["id"])
    # a viewer's token for everything still only reads
    viewer = await make(clinic, "viewer", *Scope)
    async with bearer(clinic, viewer["token"]) as client:
        assert (await client.get(f"{API}/patients")).status_code == 200
        assert (await client.post(f"{API}/patients", json={"code": "TK-3"})).status_code == 403


@sqlite_only
async def test_a_token_is_stored_as_a_hash_and_ends(clinic: Clinic) -> None:
    recording = await make(clinic, "admin", "read")
    assert re.fullmatch(r"sgt_[\w-]{43}", recording["token"])
    assert recording["token"].encode() not in clinic.settings.database.read_bytes()
    async with clinic.client("admin") as admin, bearer(clinic, recording["token"]) as client:
        assert (await client.get(f"{API}/patients")).status_code == 200
        assert (
            recording["token"]
            not in (await admin.get("/account")).text + (await admin.get(f"{API}/audit")).text
        )
        listed = (await admin.get(f"{API}/account/tokens")).json()
        assert listed[0]["used_at"] is not None
        with clinic.db.write() as c:
            c.execute(update(api_token).values(expires_at=now() - dt.timedelta(seconds=1)))
        assert (await client.get(f"{API}/patients")).status_code == 401
        other_recording = await make(clinic, "admin", "read")
        client.headers["authorization"] = f"Bearer {other_recording['token']}"
        assert (await client.get(f"{API}/patients")).status_code == 200
        assert (await admin.delete(f"{API}/account/tokens/{other_recording['id']}")).status_code == 204
        assert (await client.get(f"{API}/patients")).status_code == 401
        assert (await admin.delete(f"{API}/account/tokens/{other_recording['id']}")).status_code == 404
        # a closed account has no working token
        closed = await make(clinic, "assistant", "read")
        client.headers["authorization"] = f"Bearer {closed['token']}"
        assert (await client.get(f"{API}/patients")).status_code == 200
        await admin.patch(f"{API}/users/{clinic.users['assistant']}", json={"active": False})
        assert (await client.get(f"{API}/patients")).status_code == 401
        wrong = {"name": "x", "scopes": ["read"], "days": 1, "password": "not the password"}
        assert (await admin.post(f"{API}/account/tokens", json=wrong)).status_code == 403


def test_no_scope_reaches_accounts_audit_or_deletion() -> None:
    every = frozenset[Action]().union(*SCOPES.values())
    assert every <= set(POLICY)
    assert not every & {
        Action.USE_ACCOUNT, Action.MANAGE_USERS, Action.READ_AUDIT, Action.DELETE_PATIENT,
        Action.DELETE_SESSION, Action.RUN_LIVE,
    }  # fmt: skip
