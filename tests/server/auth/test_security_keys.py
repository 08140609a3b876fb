"""Security keys with a password, and attacks on them."""

from __future__ import annotations

import asyncio
import datetime as dt
from collections.abc import AsyncIterator, Callable, Mapping
from typing import Any

import httpx
import pyotp
import pytest
from sqlalchemy import select, update

from sagittal.server.auth import second_factor
from sagittal.server.auth.throttle import Throttle
from sagittal.server.storage.schema.person_tables import security_key, security_key_challenge
from tests.helpers.clinic import PASSWORD, Clinic
from tests.server.auth.soft_key import SoftKey

pytestmark = pytest.mark.anyio
API, HERE = "/api/v1", "http://localhost"


@pytest.fixture
async def person(clinic: Clinic) -> AsyncIterator[tuple[httpx.AsyncClient, list[str]]]:
    """A clinician with a second factor who came by the name localhost, and the recovery codes."""
    clinic.app.state.throttle = Throttle()
    user_id = clinic.user("clinician")
    key = clinic.settings.second_factor_key
    with clinic.db.write() as c:
        second_factor.remove(c, user_id)
        session = second_factor.begin(c, key, user_id, "clinician")
        codes = second_factor.confirm(c, key, user_id, pyotp.TOTP(session.secret).now())
    cookie = {"Cookie": f"sid={clinic.token('clinician')}"}
    async with clinic.client(headers=cookie) as client:
        client.base_url = httpx.URL(HERE)
        yield client, codes


async def ask(client: httpx.AsyncClient, codes: list[str]) -> dict[str, Any]:
    proofs = {"password": PASSWORD, "code": codes.pop()}
    answer = await client.post(f"{API}/account/security-keys/options", json=proofs)
    assert answer.status_code == 200, answer.text
    options: dict[str, Any] = answer.json()["options"]
    return options


async def set_up(client: httpx.AsyncClient, codes: list[str], position: str = HERE) -> SoftKey:
    key = SoftKey()
    body = {"name": "blue", "key": key.create(await ask(client, codes), position)}
    answer = await client.post(f"{API}/account/security-keys", json=body)
    assert answer.status_code == 201, answer.text
    return key


async def challenge(clinic: Clinic, name: str = "clinician", at: str = HERE) -> httpx.Response:
    async with clinic.client() as client:
        client.base_url = httpx.URL(at)
        return await client.post(f"{API}/sign-in/security-key", json={"name": name, "password": PASSWORD})


async def sign_in(
    clinic: Clinic, key: Mapping[str, Any] | None = None, code: str | None = None, at: str = HERE
) -> httpx.Response:
    body = {"name": "clinician", "password": PASSWORD, "key": key, "code": code}
    async with clinic.client() as client:
        client.base_url = httpx.URL(at)
        return await client.post(f"{API}/sign-in", json=body)


@pytest.mark.slow
async def test_a_key_takes_the_place_of_the_code(
    clinic: Clinic, person: tuple[httpx.AsyncClient, list[str]]
) -> None:
    client, codes = person
    key = await set_up(client, codes)
    assert (await sign_in(clinic)).json()["code"] == "code_needed"
    options = (await challenge(clinic)).json()["options"]
    assert options["rpId"] == "localhost"
    answer = key.get(options, HERE)
    assert (await sign_in(clinic, answer)).status_code == 200
    assert (await sign_in(clinic, answer)).json()["code"] == "key_refused"  # a challenge is answered once
    (listed,) = (await client.get(f"{API}/account/security-keys")).json()
    assert (listed["name"], listed["host"], bool(listed["used_at"])) == ("blue", "localhost", True)
    assert "blue" in (await client.get("/account")).text
    path = f"{API}/account/security-keys/{listed['id']}/remove"
    proofs = {"password": PASSWORD, "code": codes.pop()}
    async with clinic.client("viewer") as other_client:
        assert (await other_client.post(path, json=proofs)).status_code == 404
    assert (await client.post(path, json=proofs | {"password": "wrong"})).status_code == 403
    assert (await client.post(path, json=proofs)).status_code == 204
    assert (await challenge(clinic)).status_code == 404
    async with clinic.client("admin") as admin:
        rows = (await admin.get(f"{API}/audit")).json()
        assert "signed in with password and security key" in (await admin.get("/audit")).text
    assert next(row["detail"] for row in rows if row["action"] == "sign_in") == {"factor": "security_key"}
    actions = [row["action"] for row in rows]
    assert {"user.security_key_added", "user.security_key_removed", "sign_in.failed"} <= set(actions)


@pytest.mark.slow
async def test_what_an_intruder_answers_is_refused(
    clinic: Clinic, person: tuple[httpx.AsyncClient, list[str]]
) -> None:
    client, codes = person
    key, stranger = await set_up(client, codes), SoftKey()

    async def given() -> dict[str, Any]:
        options: dict[str, Any] = (await challenge(clinic)).json()["options"]
        return options

    def same_id(options: dict[str, Any]) -> dict[str, Any]:
        return SoftKey(key.id, stranger.private, 9).get(options, HERE)

    def as_registered(options: dict[str, Any]) -> dict[str, Any]:
        return key.create({**options, "rp": {"id": "localhost"}}, HERE)

    lies: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
        "another origin": lambda o: key.get(o, "https://localhost.evil.example"),
        "another port": lambda o: key.get(o, "http://localhost:81"),
        "another host": lambda o: key.get(o, HERE, host="evil.example"),
        "nobody touched it": lambda o: key.get(o, HERE, flags=0),
        "made-up challenge": lambda o: key.get({**o, "challenge": "AAAA"}, HERE),
        "another key": lambda o: stranger.get(o, HERE),
        "another key by its id": same_id,
        "a set-up": as_registered,
        "nothing": lambda o: {},
        "no text": lambda o: {"response": {"clientDataJSON": 5}, "rawId": []},
        "deep": lambda o: {**key.get(o, HERE), "rawId": "\u0000"},
    }
    for name, lie in lies.items():
        clinic.app.state.throttle = Throttle()
        answer = await sign_in(clinic, lie(await given()))
        assert (answer.status_code, answer.json()["code"]) == (401, "key_refused"), name
    # a challenge for setting up does not sign in, nor one of another account
    clinic.app.state.throttle = Throttle()
    options = await ask(client, codes)
    assert (await sign_in(clinic, key.get({**options, "rpId": "localhost"}, HERE))).status_code == 401
    # a challenge that was answered wrongly is spent
    options = await given()
    assert (await sign_in(clinic, key.get(options, "http://evil.example"))).status_code == 401
    assert (await sign_in(clinic, key.get(options, HERE))).status_code == 401
    # one that is over, too
    options = await given()
    with clinic.db.write() as c:
        c.execute(update(security_key_challenge).values(expires_at=dt.datetime.now(dt.UTC)))
    assert (await sign_in(clinic, key.get(options, HERE))).status_code == 401
    # a copy of the key that has signed less often
    assert (await sign_in(clinic, key.get(await given(), HERE))).status_code == 200
    key.count -= 3
    assert (await sign_in(clinic, key.get(await given(), HERE))).status_code == 401


async def test_another_service_on_this_host_gets_nothing_it_can_use(
    clinic: Clinic, person: tuple[httpx.AsyncClient, list[str]]
) -> None:
    client, codes = person
    key, target = await set_up(client, codes), "http://localhost:8443"
    for requests, sent in ((HERE, target), (HERE, HERE)):
        answer = key.get((await challenge(clinic, at=requests)).json()["options"], target)
        got = await sign_in(clinic, answer, at=sent)
        assert (got.status_code, got.json()["code"]) == (401, "key_refused"), (requests, sent)
    assert (await challenge(clinic, at=target)).status_code == 404
    # a key set up at that port signs in there, and there alone
    client.base_url = httpx.URL(target)
    second = await set_up(client, codes, target)
    assert [k["host"] for k in (await client.get(f"{API}/account/security-keys")).json()] == [
        "localhost",
        "localhost:8443",
    ]
    options = (await challenge(clinic, at=target)).json()["options"]
    assert options["rpId"] == "localhost"
    assert len(options["allowCredentials"]) == 1
    assert (await sign_in(clinic, second.get(options, target), at=target)).status_code == 200
    options = (await challenge(clinic)).json()["options"]
    assert (await sign_in(clinic, second.get(options, HERE))).status_code == 401
    # a port nobody could keep is no place for keys
    client.base_url = httpx.URL(HERE)
    far = {"Host": f"localhost:{'1' * 300}"}
    proofs = {"password": PASSWORD, "code": codes.pop()}
    refused = await client.post(f"{API}/account/security-keys/options", json=proofs, headers=far)
    assert refused.json()["code"] == "no_keys_here"


async def test_of_two_answers_at_once_one_signs_in(
    clinic: Clinic, person: tuple[httpx.AsyncClient, list[str]]
) -> None:
    client, codes = person
    key = await set_up(client, codes)
    answer = key.get((await challenge(clinic)).json()["options"], HERE)
    got = await asyncio.gather(*(sign_in(clinic, answer) for _ in range(5)))
    assert sorted(g.status_code for g in got) == [200, 401, 401, 401, 401]


async def test_guessing_is_counted_as_for_codes(
    clinic: Clinic, person: tuple[httpx.AsyncClient, list[str]]
) -> None:
    client, codes = person
    await set_up(client, codes)
    got = [(await sign_in(clinic, {})).status_code for _ in range(11)]
    assert got[-1] == 429
    assert (await sign_in(clinic, code=codes[0])).status_code == 429
    wrong = {"name": "clinician", "password": "not this one"}
    async with clinic.client() as stranger:
        stranger.base_url = httpx.URL(HERE)
        assert (await stranger.post(f"{API}/sign-in/security-key", json=wrong)).status_code == 401


async def test_keys_alone_when_asked_for_and_a_way_back(
    clinic: Clinic, person: tuple[httpx.AsyncClient, list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    client, codes = person
    choose = f"{API}/account/second-factor/keys-only"
    proofs: dict[str, Any] = {"on": True, "password": PASSWORD, "code": codes[-1]}
    assert (await client.put(choose, json=proofs)).json()["code"] == "no_key"  # the code is not spent
    key = await set_up(client, codes)
    proofs["code"] = codes.pop()
    assert (await client.put(choose, json=proofs | {"password": "wrong"})).status_code == 403
    assert (await client.put(choose, json=proofs)).status_code == 204
    assert "One of your recovery codes." in (await client.get("/account")).text
    monkeypatch.setattr(second_factor, "_take_code", lambda *_: True)  # whatever the figures are
    assert (await sign_in(clinic, code="123456")).json()["code"] == "wrong_code"
    assert (
        await sign_in(clinic, key.get((await challenge(clinic)).json()["options"], HERE))
    ).status_code == 200
    assert (await sign_in(clinic, code=codes[0])).status_code == 200  # the key is lost
    (listed,) = (await client.get(f"{API}/account/security-keys")).json()
    path = f"{API}/account/security-keys/{listed['id']}/remove"
    proofs = {"password": PASSWORD, "code": codes.pop()}
    assert (await client.post(path, json=proofs | {"code": "123456"})).json()["code"] == "wrong_code"
    assert (await client.post(path, json=proofs)).status_code == 204
    assert (await sign_in(clinic, code="123456")).status_code == 200  # without a key figures count again


async def test_keys_of_another_port_do_not_make_keys_alone(
    clinic: Clinic, person: tuple[httpx.AsyncClient, list[str]]
) -> None:
    client, codes = person
    choose, keys, target = (
        f"{API}/account/second-factor/keys-only", f"{API}/account/security-keys", "http://localhost:8443"
    )  # fmt: skip
    client.base_url = httpx.URL(target)
    await set_up(client, codes, target)
    client.base_url = httpx.URL(HERE)
    on: dict[str, Any] = {"on": True, "password": PASSWORD}
    refused = await client.put(choose, json=on | {"code": codes[-1]})
    assert (refused.status_code, refused.json()["code"]) == (409, "no_key")
    await set_up(client, codes)
    assert (await client.put(choose, json=on | {"code": codes.pop()})).status_code == 204
    mine = next(k["id"] for k in (await client.get(keys)).json() if k["host"] == "localhost")
    proofs = {"password": PASSWORD, "code": codes.pop()}
    assert (await client.post(f"{keys}/{mine}/remove", json=proofs)).status_code == 204
    with clinic.db.read() as c:
        assert not second_factor.takes_keys_only(c, clinic.user("clinician"))


async def test_the_password_alone_changes_no_key(
    clinic: Clinic, person: tuple[httpx.AsyncClient, list[str]]
) -> None:
    client, codes = person
    spent = codes[-1]
    await set_up(client, codes)
    keys, only = f"{API}/account/security-keys", f"{API}/account/second-factor/keys-only"
    (listed,) = (await client.get(keys)).json()
    more: dict[str, Any]
    for method, path, more in (
        ("POST", f"{keys}/options", {}),
        ("POST", f"{keys}/{listed['id']}/remove", {}),
        ("PUT", only, {"on": True}),
    ):
        body = {"password": PASSWORD, **more}
        assert (await client.request(method, path, json=body)).status_code == 422, path
        refused = await client.request(method, path, json=body | {"code": spent})
        assert (refused.status_code, refused.json()["code"]) == (403, "wrong_code"), path
    assert len((await client.get(keys)).json()) == 1
    guess = {"password": PASSWORD, "code": "nonsense"}
    got = [(await client.post(f"{keys}/options", json=guess)).status_code for _ in range(8)]
    assert got == [403] * 7 + [429]
    async with clinic.client("admin") as admin:
        actions = [row["action"] for row in (await admin.get(f"{API}/audit")).json()]
    assert "user.recovery_code_used" in actions


async def test_with_the_second_factor_its_keys_go(
    clinic: Clinic, person: tuple[httpx.AsyncClient, list[str]]
) -> None:
    client, codes = person
    key = await set_up(client, codes)
    options = (await challenge(clinic)).json()["options"]
    async with clinic.client("admin") as admin:
        gone = await admin.delete(f"{API}/users/{clinic.user('clinician')}/second-factor")
        assert gone.status_code == 204
    with clinic.db.read() as c:
        assert c.execute(select(security_key)).all() == []
        assert c.execute(select(security_key_challenge)).all() == []
    assert (await challenge(clinic)).status_code == 404
    # the password alone is enough now; what an old key says is not looked at
    assert (await sign_in(clinic, key.get(options, HERE))).status_code == 200


async def test_a_key_is_set_up_once_for_one_account_and_one_name(
    clinic: Clinic, person: tuple[httpx.AsyncClient, list[str]]
) -> None:
    client, codes = person
    key, add = await set_up(client, codes), f"{API}/account/security-keys"
    for lie in (
        key.create(await ask(client, codes), HERE),  # there already
        SoftKey().create(await ask(client, codes), "http://evil.example"),
        SoftKey().create(await ask(client, codes), HERE, host="evil.example"),
        SoftKey().create({**await ask(client, codes), "challenge": "AAAA"}, HERE),
        {},
    ):
        assert (await client.post(add, json={"name": "x", "key": lie})).status_code == 403
    async with clinic.client("admin") as admin:
        rows = (await admin.get(f"{API}/audit")).json()
    tries = [row for row in rows if row["action"] == "user.security_key_refused"]
    assert [row["user_name"] for row in tries] == ["clinician"] * 5
    # a challenge that was answered wrongly is spent
    options = await ask(client, codes)
    for moment in ("http://evil.example", HERE):
        body = {"name": "x", "key": SoftKey().create(options, moment)}
        assert (await client.post(add, json=body)).json()["code"] == "key_refused", moment
    client.base_url = httpx.URL("http://127.0.0.1")
    proofs = {"password": PASSWORD, "code": codes.pop()}
    refused = await client.post(f"{add}/options", json=proofs)
    assert refused.json()["code"] == "no_keys_here"
    assert (await challenge(clinic, at="http://127.0.0.1")).status_code == 404
    async with clinic.client("viewer") as other_client:
        other_client.base_url = httpx.URL(HERE)
        refused = await other_client.post(f"{add}/options", json=proofs)
        assert refused.status_code in {401, 409}
