from __future__ import annotations

import datetime as dt
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import func, select

from server.auth import accounts, one_time
from server.auth.roles import Role
from server.auth.sessions import Logins
from server.auth.throttle import MAX_PER_PAIR, Throttle
from server.auth.tokens import token_hash
from server.storage import sqlite_file
from server.storage.db import Database
from server.storage.tables import login_session, metadata, one_time_token
from tests.helpers.databases import write_database
from tests.helpers.engines import on_both_engines
from tests.server.clinic import PASSWORD, Clinic, open_clinic

pytestmark = [pytest.mark.anyio, on_both_engines]

IDLE, ABSOLUTE = dt.timedelta(minutes=15), dt.timedelta(hours=12)


class Clock:
    def __init__(self) -> None:
        self.now = dt.datetime(2026, 3, 1, 9, tzinfo=dt.UTC)

    def __call__(self) -> dt.datetime:
        return self.now

    def passes(self, **duration: float) -> None:
        self.now += dt.timedelta(**duration)


def open_login(clinic: Clinic, clock: Clock) -> tuple[Logins, str]:
    logins = Logins(clinic.db, IDLE, ABSOLUTE, clock)
    user = clinic.user("clinician")
    with clinic.db.write() as c:
        return logins, logins.start(c, user, None)


async def test_a_sign_in_ends_after_fifteen_idle_minutes(clinic: Clinic) -> None:
    clock = Clock()
    logins, token = open_login(clinic, clock)
    clock.passes(minutes=14.9)
    assert logins.find(token) is not None
    clock.passes(minutes=14.9)
    assert logins.find(token) is not None
    clock.passes(minutes=15)
    assert logins.find(token) is None


@pytest.mark.slow
async def test_a_running_view_counts_as_activity_until_the_absolute_end(clinic: Clinic) -> None:
    clock = Clock()
    logins, token = open_login(clinic, clock)
    identity = logins.find(token)
    assert identity is not None
    minutes = 0
    while logins.touch(identity.login_id) is not None:
        clock.passes(minutes=1)
        minutes += 1
    assert minutes == 12 * 60


async def test_asking_how_long_a_sign_in_lasts_does_not_prolong_it(clinic: Clinic) -> None:
    clock = Clock()
    logins, token = open_login(clinic, clock)
    identity = logins.find(token)
    assert identity is not None
    clock.passes(minutes=10)
    assert logins.look(token) == identity
    assert logins.seconds_left(identity.login_id) == 5 * 60
    clock.passes(minutes=4)
    assert logins.seconds_left(identity.login_id) == 60
    clock.passes(minutes=1)
    assert logins.look(token) is None
    assert logins.seconds_left(identity.login_id) == 0.0
    async with clinic.client("viewer") as client:
        found = (await client.get("/api/v1/sign-in")).json()
        assert found["name"] == "viewer"
        assert 0 < found["left_s"] <= IDLE.total_seconds()


async def test_activity_is_written_at_most_every_half_minute(clinic: Clinic) -> None:
    clock = Clock()
    logins, token = open_login(clinic, clock)

    def seen(db: Database) -> list[dt.datetime]:
        with db.read() as c:
            return sorted(c.execute(select(login_session.c.last_seen_at)).scalars())

    before = seen(clinic.db)
    clock.passes(seconds=29)
    logins.find(token)
    assert seen(clinic.db) == before
    clock.passes(seconds=2)
    logins.find(token)
    assert seen(clinic.db) != before


async def test_the_database_never_holds_the_token(clinic: Clinic) -> None:
    token = clinic.token("viewer")
    with clinic.db.read() as c:
        rows = "".join(str(c.execute(select(table)).all()) for table in metadata.sorted_tables)
    files = [p.read_bytes() for p in clinic.settings.data_dir.rglob("*") if p.is_file()]
    assert token_hash(token) in rows
    assert token not in rows
    assert not any(token.encode() in content for content in files)


async def test_a_planted_session_does_not_survive_the_sign_in(clinic: Clinic) -> None:
    """Session fixation: what the browser came with is never what it leaves with."""
    clinic.user("viewer")
    attacker = clinic.token("viewer")
    for planted in ("a-value-the-attacker-chose", attacker):
        async with clinic.client() as client:
            answer = await client.post(
                "/api/v1/sign-in",
                json={"name": "viewer", "password": PASSWORD},
                headers={"Cookie": f"sid={planted}"},
            )
            assert answer.status_code == 200
            assert answer.cookies["sid"] != planted
        assert clinic.app.state.logins.find(planted) is None


async def test_sign_out_ends_the_session_on_the_server(clinic: Clinic) -> None:
    token = clinic.token("viewer")
    async with clinic.client(headers={"Cookie": f"sid={token}"}) as client:
        assert (await client.get("/api/v1/account")).status_code == 200
        answer = await client.post("/api/v1/sign-out")
        assert answer.status_code == 204
        assert 'sid=""' in answer.headers["set-cookie"]
        assert (await client.get("/api/v1/account")).status_code == 401


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


async def test_unknown_names_and_wrong_passwords_get_the_same_answer(clinic: Clinic) -> None:
    clinic.user("viewer")
    async with clinic.client() as client:
        answers = [
            await client.post("/api/v1/sign-in", json={"name": name, "password": "wrong password"})
            for name in ("viewer", "nobody")
        ]
    assert answers[0].status_code == 401
    assert answers[0].json() == answers[1].json()


async def test_a_form_signs_in_without_scripts_and_never_leads_elsewhere(clinic: Clinic) -> None:
    clinic.user("viewer")
    for wanted, got in (
        ("/jobs", "/jobs"),
        ("//evil.example", "/patients"),
        ("https://evil.example", "/patients"),
    ):
        async with clinic.client() as client:
            form = {"name": "viewer", "password": PASSWORD, "next": wanted}
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
            again = await client.post(f"/api/v1/set-up/{token}", json=body)
            assert (again.status_code, again.json()["code"]) == (404, "link_not_valid")
        with clinic.db.write() as c:
            other = one_time.issue_set_up(c)
            assert not one_time.is_valid(c, other, "set_up")


async def test_web_servers_with_a_shared_key_issue_one_set_up_address(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with open_clinic(tmp_path) as clinic:

        def issue(key: bytes) -> str:
            with clinic.db.write() as c:
                return one_time.issue_set_up(c, key)

        token = issue(b"key of both")
        assert issue(b"key of both") == token
        other = issue(b"another key")
        assert other != token
        with clinic.db.read() as c:
            assert not one_time.is_valid(c, token, "set_up")
            assert one_time.is_valid(c, other, "set_up")
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
    clinic.user("viewer", "edda")
    other = clinic.token("viewer", "edda")
    mine = clinic.token("viewer", "edda")
    async with clinic.client(headers={"Cookie": f"sid={mine}"}) as client:
        path = "/api/v1/account/password"
        wrong = await client.post(path, json={"current": "not my password", "password": "another good one"})
        assert (wrong.status_code, wrong.json()["code"]) == (403, "wrong_password")
        right = await client.post(path, json={"current": PASSWORD, "password": "another good one"})
        assert right.status_code == 204
        assert (await client.get("/api/v1/account")).status_code == 200
    assert clinic.app.state.logins.find(other) is None


async def test_the_last_administrator_cannot_be_lost(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic:
        admin = clinic.user("admin")
        async with clinic.client("admin") as client:
            for change in ({"role": "viewer"}, {"active": False}):
                answer = await client.patch(f"/api/v1/users/{admin}", json=change)
                assert (answer.status_code, answer.json()["code"]) == (409, "last_administrator")
            taken = await client.post(
                "/api/v1/users", json={"name": "admin", "role": "viewer", "password": PASSWORD}
            )
            assert (taken.status_code, taken.json()["code"]) == (409, "name_taken")
        with clinic.db.read() as c:
            assert accounts.get(c, admin).role == Role.ADMIN
            assert c.execute(select(func.count()).select_from(login_session)).scalar_one() == 1


def test_a_sign_in_is_read_while_another_program_holds_the_database(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite_file, "BUSY_TIMEOUT_MS", 1)
    write_database(tmp_path / "a.db")
    clock = Clock()
    with closing(Database(tmp_path / "a.db")) as db, closing(Database(tmp_path / "a.db")) as other:
        logins = Logins(db, IDLE, ABSOLUTE, clock)
        with db.write() as c:
            token = logins.start(c, accounts.create(c, "anna", None, Role.VIEWER, "x").id, None)
        with other.write():
            for _ in range(3):
                clock.now += IDLE * 0.9  # activity keeps it open though none can be written
                assert logins.find(token) is not None
        clock.now += IDLE * 0.9
        assert logins.find(token) is not None
