"""Every route of the real application, with real objects, for whoever must not have them."""

from __future__ import annotations

import datetime as dt
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from typing import Any

import httpx
import pytest
from sqlalchemy import insert, update
from sqlalchemy.exc import OperationalError
from starlette.requests import HTTPConnection

from sagittal.server.auth import api_tokens
from sagittal.server.auth.access import find_end, wait_for_end
from sagittal.server.auth.api_tokens import SCOPES, Scope
from sagittal.server.auth.roles import POLICY, PUBLIC, Action, Role
from sagittal.server.auth.routes import list_declared_actions
from sagittal.server.auth.throttle import MAX_PER_PAIR
from sagittal.server.auth.tokens import new_token, token_hash
from sagittal.server.storage.schema.care_tables import emergency_access
from sagittal.server.storage.schema.person_tables import api_token, second_factor, security_key
from sagittal.server.storage.schema.tables import login_session, metadata, new_id, user
from tests.helpers.clinic import ORIGIN, PASSWORD, Clinic, open_clinic
from tests.helpers.engines import on_both_engines
from tests.server.belongings import OF_NOBODY, add_belongings, fill_address
from tests.server.sockets import ask_websocket

pytestmark = [pytest.mark.anyio, on_both_engines]

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
async def ward(
    tmp_path_factory: pytest.TempPathFactory, anyio_backend: str, engine: str
) -> AsyncIterator[Ward]:
    async with open_clinic(tmp_path_factory.mktemp("belongings")) as clinic:
        owner = clinic.user("clinician", "owner")
        with clinic.db.write() as c:
            row, _ = api_tokens.issue(c, owner, "gait lab", [Scope.READ], 9)
            c.execute(
                insert(second_factor).values(
                    user_id=owner, secret=b"sealed", recovery=[], last_step=0, confirmed_at=LONG_AGO
                )
            )
            key = new_id()
            retained = {"host": "localhost", "credential_id": b"1", "public_key": b"2", "sign_count": 0}
            c.execute(
                insert(security_key).values(
                    id=key, user_id=owner, name="blue", created_at=LONG_AGO, **retained
                )
            )
        of_owner = {"user_id": owner, "token_id": row.id, "key_id": key, "token": new_token()}
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


@pytest.mark.slow
@pytest.mark.parametrize("who", STRANGERS)
async def test_a_stranger_reaches_nothing_that_is_there(ward: Ward, who: str) -> None:
    headers = STRANGERS[who](ward)
    initial_rows, wrong = ward.rows(), []
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
    assert ward.rows() == initial_rows


@pytest.mark.slow
@pytest.mark.parametrize("role", Role)
async def test_a_role_reads_and_changes_nothing_it_may_not(ward: Ward, role: Role) -> None:
    headers = {"Cookie": f"sid={ward.clinic.token(role)}"}
    initial_rows, wrong = ward.rows(), []
    for route, action in ward.actions.items():
        if action not in PUBLIC and role not in POLICY[action]:
            answer = await ward.ask(route, ward.one, **headers)
            if answer.status_code != 403 or "Alder" in answer.text:
                wrong.append((route, answer.status_code))
    assert wrong == []
    assert ward.rows() == initial_rows


@pytest.mark.slow
@pytest.mark.parametrize("scope", Scope)
async def test_a_token_does_nothing_beyond_its_scope(ward: Ward, scope: Scope) -> None:
    headers = _token(ward, "admin", [scope], used_at=dt.datetime.now(dt.UTC))
    initial_rows, wrong = ward.rows(), []
    for route, action in ward.actions.items():
        if action in PUBLIC or action in SCOPES[scope]:
            continue
        answer = await ward.ask(route, ward.one, **headers)
        by_its_door = route.split(" ")[1].startswith(("/api/v1/", "/metrics")) and "SOCKET" not in route
        if answer.status_code != (403 if by_its_door else 401):
            wrong.append((route, answer.status_code))
    assert wrong == []
    assert ward.rows() == initial_rows


async def test_what_belongs_to_one_visit_is_not_reached_through_another(ward: Ward) -> None:
    """Each route with two parts in its address: one of them of the other patient."""
    headers = {"Cookie": f"sid={ward.clinic.token('admin')}"}
    crossed = [
        (r, [n for n in ("upload_id", "other_id", "other") if f"{{{n}}}" in r])
        for r in ward.actions
        if any(f"{{{n}}}" in r for n in ("upload_id", "other_id", "other"))
    ]
    assert len(crossed) > 5
    initial_rows, wrong = ward.rows(), []
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
    assert ward.rows() == initial_rows


@pytest.mark.slow
@pytest.mark.parametrize("role", Role)
async def test_nobody_touches_what_opens_the_account_of_another(ward: Ward, role: Role) -> None:
    """Only administrators may remove another account's second factor; nobody sees its tokens."""
    async with ward.clinic.client(role) as client:
        initial_rows = ward.rows()
        listed = await client.get("/api/v1/account/tokens")
        assert ward.one["token_id"] not in listed.text
        revoked = await client.delete(f"/api/v1/account/tokens/{ward.one['token_id']}")
        assert revoked.status_code == 404
        keys = "/api/v1/account/security-keys"
        assert (await client.get(keys)).json() == []
        proofs = {"password": PASSWORD, "code": "123456"}
        forgotten = await client.post(f"{keys}/{ward.one['key_id']}/remove", json=proofs)
        assert forgotten.status_code == 404
        if role is not Role.ADMIN:
            response = await client.delete(f"/api/v1/users/{ward.one['user_id']}/second-factor")
            assert response.status_code == 403
    assert ward.rows() == initial_rows


@pytest.mark.parametrize("headers", [{}, {"Authorization": "Bearer x"}, {"Authorization": "Bearer "}])
async def test_a_take_is_filmed_by_its_own_tablet_only(ward: Ward, headers: dict[str, str]) -> None:
    own = {"Authorization": f"Bearer {ward.two['link_id']}"}
    initial_rows, wrong = ward.rows(), []
    films = [r for r in ward.actions if "{take_id}" in r]
    assert films
    for route in films:
        for message in (headers, own):  # none, and that of the other patient's take
            answer = await ward.ask(route, ward.one, **message)
            if answer.status_code not in {401, 403, 404, 422}:
                wrong.append((route, answer.status_code))
    assert wrong == []
    assert ward.rows() == initial_rows


LISTS = (
    "/patients", "/patients?q=Alder", "/api/v1/patients", "/api/v1/patients?q=Alder", "/jobs", "/api/v1/jobs",
    "/study", "/study?q=Alder", "/sensors", "/api/v1/devices", "/api/v1/devices.csv", "/account",
)  # fmt: skip


async def teams(ward: Ward, *, on: bool) -> None:
    async with ward.clinic.client("admin") as client:
        answer = await client.put("/api/v1/care-teams", json={"on": on})
        assert answer.json() == {"on": on}


async def join(ward: Ward, patient: Mapping[str, str], *users: str) -> None:
    async with ward.clinic.client("admin") as client:
        to = f"/api/v1/patients/{patient['pid']}/care-team"
        answer = await client.put(to, json={"users": [ward.clinic.user(role) for role in users]})
        assert answer.status_code == 200, answer.text


@pytest.fixture
async def guarded(ward: Ward) -> AsyncIterator[Ward]:
    """Ward with care teams: all accounts in Birch, none in Alder."""
    await join(ward, ward.two, "clinician", "assistant", "viewer")
    await teams(ward, on=True)
    yield ward
    await teams(ward, on=False)
    await join(ward, ward.one)


def with_owner(ward: Ward) -> list[str]:
    """Routes whose address contains a patient's object, found independently of the access rule."""
    names = ward.one.keys() - OF_NOBODY.keys() - {"user_id", "token_id", "key_id", "token"}
    return [r for r in ward.actions if any(f"{{{name}}}" in r for name in names)]


@pytest.mark.slow
@pytest.mark.parametrize("role", [Role.CLINICIAN, Role.ASSISTANT, Role.VIEWER])
async def test_outside_the_care_team_nothing_of_a_patient_is_seen_or_changed(
    guarded: Ward, role: Role
) -> None:
    headers = {"Cookie": f"sid={guarded.clinic.token(role)}"}
    routes = [r for r in with_owner(guarded) if (a := guarded.actions[r]) not in PUBLIC and role in POLICY[a]]
    assert len(routes) > 15
    initial_rows, wrong = guarded.rows(), []
    for route in routes:
        answer = await guarded.ask(route, guarded.one, **headers)
        nobody = dict.fromkeys(guarded.one, "0" * 32) | OF_NOBODY
        unknown = await guarded.ask(route, nobody, **headers) if route.startswith("GET /api") else answer
        if (answer.status_code, answer.text) != (404, unknown.text) or "Alder" in answer.text:
            wrong.append((route, answer.status_code))
    assert wrong == []
    assert guarded.rows() == initial_rows


@pytest.mark.slow
@pytest.mark.parametrize("role", [Role.CLINICIAN, Role.ASSISTANT, Role.VIEWER])
async def test_no_list_shows_a_patient_of_another_team(guarded: Ward, role: Role) -> None:
    lists = {
        f"GET {path}" for path in (p.partition("?")[0] for p in LISTS)
    }  # every page and answer that names nothing of a patient is among them, or names nobody
    remaining = {r for r in guarded.actions if r.startswith("GET") and "{" not in r} - lists - NAMES_NOBODY
    assert remaining == set(), "say whether these lists show patients"
    async with guarded.clinic.client(role) as client:
        for path in LISTS:
            answer = await client.get(path)
            assert answer.status_code in {200, 403}, path
            assert guarded.one["pid"] not in answer.text, path
            visible_variant = (
                answer.text.replace("q=Alder", "").replace('value="Alder"', "").replace("“Alder”", "")
            )
            assert "Alder" not in visible_variant, path
        for path in ("/patients", "/api/v1/patients", "/jobs", "/api/v1/jobs"):
            assert "Birch" in (await client.get(path)).text, path
        assert " 1 of 1" in " ".join((await client.get("/patients")).text.split())
        tables = await client.get("/api/v1/study.zip", params={"q": "Alder"})
        assert tables.status_code == (409 if role is Role.CLINICIAN else 403)


NAMES_NOBODY = {
    "GET /api/v1/sign-in", "GET /api/v1/account", "GET /api/v1/account/tokens",
    "GET /api/v1/account/security-keys",
    "GET /api/v1/estimators",
    "GET /api/v1/filters", "GET /api/v1/openapi.json", "GET /health/live", "GET /health/ready",
    "GET /capture", "GET /", "GET /sign-in",
    "GET /api/v1/study.zip",  # pseudonyms; asked below
    # administrators
    "GET /metrics", "GET /audit", "GET /api/v1/audit", "GET /api/v1/audit/head", "GET /users",
    "GET /api/v1/users", "GET /system", "GET /api/v1/care-teams",
}  # fmt: skip


async def test_a_member_and_an_administrator_see_the_patient(guarded: Ward) -> None:
    await join(guarded, guarded.one, "viewer")
    for role in ("viewer", "admin"):
        async with guarded.clinic.client(role) as client:
            assert "Alder" in (await client.get("/patients")).text
            assert (await client.get(f"/patients/{guarded.one['pid']}")).status_code == 200
            assert (await client.get(f"/api/v1/jobs/{guarded.one['job_id']}")).status_code == 200
    async with guarded.clinic.client("viewer") as client:
        address = f"/api/v1/patients/{guarded.one['pid']}/care-team"
        assert [m["name"] for m in (await client.get(address)).json()["members"]] == ["viewer"]
        assert (await client.put(address, json={"users": []})).status_code == 403
        assert (await client.put("/api/v1/care-teams", json={"on": False})).status_code == 403
    await join(guarded, guarded.one)
    async with guarded.clinic.client("viewer") as client:
        assert (await client.get(f"/patients/{guarded.one['pid']}")).status_code == 404


async def test_who_adds_a_patient_is_in_the_team(guarded: Ward) -> None:
    async with guarded.clinic.client("clinician") as client:
        body = (await client.post("/api/v1/patients", json={"code": "Cedar"})).json()["id"]
        assert (await client.get(f"/api/v1/patients/{body}")).status_code == 200
    async with guarded.clinic.client("viewer") as client:
        assert (await client.get(f"/api/v1/patients/{body}")).status_code == 404


async def test_an_emergency_opens_a_patient_for_a_time_and_everybody_concerned_sees_it(guarded: Ward) -> None:
    address, door = f"/api/v1/patients/{guarded.one['pid']}", "/api/v1/emergency-accesses"
    reason = {"code": "Alder", "reason": "Fell in the corridor, Dr Elm asks for the last walk."}
    async with guarded.clinic.client("viewer") as client:
        assert (await client.post(door, json=reason)).status_code == 403
    token = _token(guarded, "clinician", list(Scope))
    async with guarded.clinic.client(headers=token) as client:
        assert (await client.post(door, json=reason)).status_code == 403  # a program is in no emergency
    async with guarded.clinic.client("clinician") as client:
        assert (await client.get(address)).status_code == 404
        assert (await client.post(door, json=reason | {"reason": "     urgent        "})).status_code == 422
        assert (await client.post(door, json=reason | {"code": "alder"})).status_code == 404
        assert (await client.get(address)).status_code == 404
        opened = await client.post(door, json=reason)
        assert opened.status_code == 201, opened.text
        assert (await client.get(address)).status_code == 200
        assert "Alder" in (await client.get("/patients")).text
        assert (await client.post(door, json=reason)).json()["code"] == "seen_already"
        assert (await client.post(door, json=reason | {"code": "Birch"})).json()["code"] == "seen_already"
    async with guarded.clinic.client("admin") as client:
        assert "Dr Elm" in (await client.get(f"/patients/{guarded.one['pid']}")).text
        log = (await client.get("/audit")).text
        assert "opened the patient with emergency access" in log
        assert "Dr Elm" in log
        rows = (await client.get("/api/v1/audit")).text
        assert "emergency.refused" in rows
        assert "Dr Elm" not in rows  # the log outlives the patient
    with guarded.clinic.db.write() as c:
        long = {"opened_at": LONG_AGO, "ends_at": dt.datetime.now(dt.UTC)}
        c.execute(update(emergency_access).values(**long))
    async with guarded.clinic.client("clinician") as client:
        assert (await client.get(address)).status_code == 404
        assert "Alder" not in (await client.get("/patients")).text


async def test_an_open_line_ends_with_the_access(guarded: Ward) -> None:
    await join(guarded, guarded.one, "clinician")
    scope: dict[str, Any] = {
        "type": "http", "app": guarded.clinic.app, "path": "/api/v1/x", "query_string": b"",
        "path_params": {"sid": guarded.one["sid"]},
        "headers": [(b"cookie", f"sid={guarded.clinic.token('clinician')}".encode())],
    }  # fmt: skip
    assert find_end(HTTPConnection(scope)) is None
    await join(guarded, guarded.one)
    assert find_end(HTTPConnection(scope)) == "not_found"
    assert find_end(HTTPConnection(scope), sid=guarded.two["sid"]) is None


async def test_an_open_line_outlasts_a_database_that_is_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sagittal.server.auth.access.CHECK_EVERY_S", 0.0)
    answers: list[Exception | str | None] = [OperationalError("", {}, Exception()), None, "not_found"]

    def find() -> str | None:
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    assert await wait_for_end(find) == "not_found"
    assert not answers


async def test_guessing_codes_ends(guarded: Ward) -> None:
    async with guarded.clinic.client("clinician") as client:
        status_codes = [
            (
                await client.post(
                    "/api/v1/emergency-accesses", json={"code": f"P-{i}", "reason": "I am just looking."}
                )
            ).status_code
            for i in range(MAX_PER_PAIR + 1)
        ]
    assert (status_codes[0], status_codes[-1], set(status_codes)) == (404, 429, {404, 429})
