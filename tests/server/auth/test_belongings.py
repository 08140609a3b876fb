"""Every route of the real application, with real objects, for whoever must not have them."""

from __future__ import annotations

import datetime as dt
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from typing import Any

import httpx
import pytest
from sqlalchemy import insert, update

from server.auth import api_tokens
from server.auth.api_tokens import SCOPES, Scope
from server.auth.roles import POLICY, PUBLIC, Action, Role
from server.auth.routes import list_declared_actions
from server.auth.tokens import new_token, token_hash
from server.storage.person_tables import api_token, second_factor
from server.storage.tables import login_session, metadata, user
from tests.server.belongings import OF_NOBODY, add_belongings, fill_address
from tests.server.clinic import ORIGIN, Clinic, open_clinic
from tests.server.sockets import ask_websocket

pytestmark = pytest.mark.anyio

OF_WHO_ASKS = {"audit", "login_session"}
"""Tables that a refused request may write into."""
LONG_AGO = dt.datetime(2024, 1, 1, tzinfo=dt.UTC)


@dataclass
class Ward:
    """A clinic with two patients, an account with a token and a second factor, and all its routes."""

    clinic: Clinic
    one: Mapping[str, str]
    two: Mapping[str, str]
    actions: Mapping[str, Action]

    def rows(self) -> dict[str, list[Any]]:
        """Everything that is stored but who is signed in and who looked."""
        with self.clinic.db.read() as c:
            return {
                t.name: sorted(map(str, c.execute(t.select())))
                for t in metadata.sorted_tables
                if t.name not in OF_WHO_ASKS
            }

    async def ask(self, route: str, values: Mapping[str, str], **headers: str) -> httpx.Response:
        """Ask with real ids and, of what changes something, an empty body."""
        method, path = route.split(" ")[0].split(",")[0], fill_address(route, values)
        if method == "WEBSOCKET":
            return httpx.Response(await ask_websocket(self.clinic.app, path, headers))
        transport = httpx.ASGITransport(self.clinic.app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url=ORIGIN, headers=headers) as client:
            return await client.request(method, path, json=None if method in {"GET", "HEAD"} else {})


@pytest.fixture(scope="module")
async def ward(tmp_path_factory: pytest.TempPathFactory, anyio_backend: str) -> AsyncIterator[Ward]:
    async with open_clinic(tmp_path_factory.mktemp("belongings")) as clinic:
        owner = clinic.user("clinician", "owner")
        with clinic.db.write() as c:
            row, _ = api_tokens.issue(c, owner, "gait lab", [Scope.READ], 9)
            c.execute(
                insert(second_factor).values(
                    user_id=owner, secret=b"sealed", recovery=[], last_step=0, confirmed_at=LONG_AGO
                )
            )
        of_owner = {"user_id": owner, "token_id": row.id, "token": new_token()}
        one, two = (add_belongings(clinic, code) | OF_NOBODY | of_owner for code in ("Alder", "Birch"))
        actions = {k: a for k, a in list_declared_actions(clinic.app.routes).items() if "MOUNT" not in k}
        yield Ward(clinic, one, two, actions)


def _expired(ward: Ward) -> dict[str, str]:
    token = ward.clinic.token("admin")
    with ward.clinic.db.write() as c:
        mine = login_session.c.token_sha256 == token_hash(token)
        c.execute(update(login_session).where(mine).values(expires_at=LONG_AGO))
    return {"Cookie": f"sid={token}"}


def _idle(ward: Ward) -> dict[str, str]:
    token = ward.clinic.token("admin")
    with ward.clinic.db.write() as c:
        mine = login_session.c.token_sha256 == token_hash(token)
        c.execute(update(login_session).where(mine).values(last_seen_at=LONG_AGO))
    return {"Cookie": f"sid={token}"}


def _closed_account(ward: Ward) -> dict[str, str]:
    token = ward.clinic.token("admin", "left")
    with ward.clinic.db.write() as c:
        c.execute(update(user).where(user.c.name == "left").values(active=False))
    return {"Cookie": f"sid={token}"}


def _token(ward: Ward, role: str, scopes: list[Scope], **values: Any) -> dict[str, str]:
    with ward.clinic.db.write() as c:
        row, token = api_tokens.issue(c, ward.clinic.user(role), "walk", scopes, 9)
        if values:
            c.execute(update(api_token).where(api_token.c.id == row.id).values(**values))
    return {"Authorization": f"Bearer {token}"}


def _expired_token(ward: Ward) -> dict[str, str]:
    return _token(ward, "admin", list(Scope), expires_at=LONG_AGO)


STRANGERS: dict[str, Callable[[Ward], dict[str, str]]] = {
    "no sign-in": lambda ward: {},
    "made-up cookie": lambda ward: {"Cookie": f"sid={new_token()}"},
    "sign-in that is over": _expired,
    "idle sign-in": _idle,
    "closed account": _closed_account,
    "token that is over": _expired_token,
    "token as a cookie": lambda ward: {
        "Cookie": f"sid={_token(ward, 'admin', list(Scope))['Authorization'][7:]}"
    },
}


@pytest.mark.parametrize("who", STRANGERS)
async def test_a_stranger_reaches_nothing_that_is_there(ward: Ward, who: str) -> None:
    headers = STRANGERS[who](ward)
    before, wrong = ward.rows(), []
    # one function says who asks: these walk all routes, the others two doors
    is_walked = who in {"no sign-in", "sign-in that is over", "token that is over"}
    doors = ("GET /api/v1/patients/{patient_id}", "WEBSOCKET /sessions/{sid}/replay")
    routes = ward.actions if is_walked else {door: ward.actions[door] for door in doors}
    for route, action in routes.items():
        answer = await ward.ask(route, ward.one, **headers)
        if action not in PUBLIC and answer.status_code != 401:
            wrong.append((route, answer.status_code))
        elif "Alder" in answer.text or "Birch" in answer.text:
            wrong.append((f"{route} tells {answer.text[:200]}", answer.status_code))
    assert wrong == []
    assert ward.rows() == before


@pytest.mark.parametrize("role", Role)
async def test_a_role_reads_and_changes_nothing_it_may_not(ward: Ward, role: Role) -> None:
    headers = {"Cookie": f"sid={ward.clinic.token(role)}"}
    before, wrong = ward.rows(), []
    for route, action in ward.actions.items():
        if action not in PUBLIC and role not in POLICY[action]:
            answer = await ward.ask(route, ward.one, **headers)
            if answer.status_code != 403 or "Alder" in answer.text:
                wrong.append((route, answer.status_code))
    assert wrong == []
    assert ward.rows() == before


@pytest.mark.parametrize("scope", Scope)
async def test_a_token_does_nothing_beyond_its_scope(ward: Ward, scope: Scope) -> None:
    headers = _token(ward, "admin", [scope], used_at=dt.datetime.now(dt.UTC))
    before, wrong = ward.rows(), []
    for route, action in ward.actions.items():
        if action in PUBLIC or action in SCOPES[scope]:
            continue
        answer = await ward.ask(route, ward.one, **headers)
        by_its_door = route.split(" ")[1].startswith(("/api/v1/", "/metrics")) and "SOCKET" not in route
        if answer.status_code != (403 if by_its_door else 401):
            wrong.append((route, answer.status_code))
    assert wrong == []
    assert ward.rows() == before


async def test_what_belongs_to_one_visit_is_not_reached_through_another(ward: Ward) -> None:
    """Each route with two parts in its address: one of them of the other patient."""
    headers = {"Cookie": f"sid={ward.clinic.token('admin')}"}
    crossed = [
        (r, [n for n in ("upload_id", "other_id", "other") if f"{{{n}}}" in r])
        for r in ward.actions
        if any(f"{{{n}}}" in r for n in ("upload_id", "other_id", "other"))
    ]
    assert len(crossed) > 5
    before, wrong = ward.rows(), []
    for route, names in crossed:
        answer = await ward.ask(route, {**ward.one, **{n: ward.two[n] for n in names}}, **headers)
        if answer.status_code not in {404, 409, 422} or "Birch" in answer.text:
            wrong.append((route, answer.status_code))
    for visit, body in (
        (ward.one["visit_id"], {"session_id": ward.two["sid"]}),
        (ward.two["visit_id"], {"session_id": ward.one["sid"]}),
    ):
        async with ward.clinic.client("admin") as client:
            answer = await client.patch(f"/api/v1/planned-visits/{visit}", json=body)
            assert answer.status_code == 409, answer.text
    async with ward.clinic.client("admin") as client:
        body = {"title": "x", "planned_visit_id": ward.two["visit_id"]}
        answer = await client.post(f"/api/v1/patients/{ward.one['pid']}/sessions", json=body)
    assert answer.status_code == 409, answer.text
    assert wrong == []
    assert ward.rows() == before


@pytest.mark.parametrize("role", Role)
async def test_nobody_touches_what_opens_the_account_of_another(ward: Ward, role: Role) -> None:
    """Tokens and second factors: only an administrator may take a factor away, and nobody a token."""
    before = ward.rows()
    async with ward.clinic.client(role) as client:
        listed = await client.get("/api/v1/account/tokens")
        assert ward.one["token_id"] not in listed.text
        revoked = await client.delete(f"/api/v1/account/tokens/{ward.one['token_id']}")
        assert revoked.status_code == 404
        if role is not Role.ADMIN:
            taken = await client.delete(f"/api/v1/users/{ward.one['user_id']}/second-factor")
            assert taken.status_code == 403
    assert ward.rows() == before


@pytest.mark.parametrize("headers", [{}, {"Authorization": "Bearer x"}, {"Authorization": "Bearer "}])
async def test_a_take_is_filmed_by_its_own_tablet_only(ward: Ward, headers: dict[str, str]) -> None:
    own = {"Authorization": f"Bearer {ward.two['link_id']}"}
    before, wrong = ward.rows(), []
    films = [r for r in ward.actions if "{take_id}" in r]
    assert films
    for route in films:
        for said in (headers, own):  # none, and that of the other patient's take
            answer = await ward.ask(route, ward.one, **said)
            if answer.status_code not in {401, 403, 404, 422}:
                wrong.append((route, answer.status_code))
    assert wrong == []
    assert ward.rows() == before
