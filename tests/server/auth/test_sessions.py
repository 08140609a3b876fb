from __future__ import annotations

import datetime as dt
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import select

from sagittal.server.auth import accounts
from sagittal.server.auth.roles import Role
from sagittal.server.auth.sessions import Logins
from sagittal.server.auth.tokens import token_hash
from sagittal.server.storage import sqlite_file
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import login_session, metadata
from tests.helpers.clinic import PASSWORD, Clinic
from tests.helpers.databases import write_database
from tests.helpers.engines import on_both_engines

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
        body = (await client.get("/api/v1/sign-in")).json()
        assert body["name"] == "viewer"
        assert 0 < body["left_s"] <= IDLE.total_seconds()


async def test_activity_is_written_at_most_every_half_minute(clinic: Clinic) -> None:
    clock = Clock()
    logins, token = open_login(clinic, clock)

    def seen(db: Database) -> list[dt.datetime]:
        with db.read() as c:
            return sorted(c.execute(select(login_session.c.last_seen_at)).scalars())

    initial = seen(clinic.db)
    clock.passes(seconds=29)
    logins.find(token)
    assert seen(clinic.db) == initial
    clock.passes(seconds=2)
    logins.find(token)
    assert seen(clinic.db) != initial


async def test_the_database_never_holds_the_token(clinic: Clinic) -> None:
    token = clinic.token("viewer")
    with clinic.db.read() as c:
        rows = "".join(str(c.execute(select(table)).all()) for table in metadata.sorted_tables)
    files = [p.read_bytes() for p in clinic.settings.data_dir.rglob("*") if p.is_file()]
    assert token_hash(token) in rows
    assert token not in rows
    assert not any(token.encode() in content for content in files)


async def test_a_planted_session_does_not_survive_the_sign_in(clinic: Clinic) -> None:
    """Session fixation: sign-in replaces the browser's session."""
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


def test_a_sign_in_is_read_while_another_program_holds_the_database(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite_file, "BUSY_TIMEOUT_MS", 1)
    write_database(tmp_path / "a.db")
    clock = Clock()
    with closing(Database(tmp_path / "a.db")) as db, closing(Database(tmp_path / "a.db")) as other_connection:
        logins = Logins(db, IDLE, ABSOLUTE, clock)
        with db.write() as c:
            token = logins.start(c, accounts.create(c, "anna", None, Role.VIEWER, "x").id, None)
        with other_connection.write():
            for _ in range(3):
                clock.now += IDLE * 0.9  # activity keeps it open though none can be written
                assert logins.find(token) is not None
        clock.now += IDLE * 0.9
        assert logins.find(token) is not None
