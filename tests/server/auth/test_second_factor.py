"""Second factor: required, single use, rate limit, recovery without the phone."""

from __future__ import annotations

import io

import httpx
import pyotp
import pytest
from sqlalchemy import select

from sagittal.server.auth import second_factor
from sagittal.server.auth.throttle import Throttle
from sagittal.server.commands import user as user_command
from sagittal.server.storage.archive import make_key
from sagittal.server.storage.schema.person_tables import second_factor as table
from sagittal.server.storage.schema.tables import user
from tests.helpers.clinic import PASSWORD, Clinic
from tests.helpers.engines import tell_commands

pytestmark = pytest.mark.anyio
API = "/api/v1"


class At:
    """The server's clock."""

    def __init__(self) -> None:
        self.s = 1_700_000_000.0

    def time(self) -> float:
        return self.s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> At:
    result = At()
    monkeypatch.setattr(second_factor, "time", result)
    return result


async def enrol(clinic: Clinic, client: httpx.AsyncClient, clock: At) -> tuple[pyotp.TOTP, list[str]]:
    answer = (await client.post(f"{API}/account/second-factor", json={"password": PASSWORD})).json()
    assert answer["picture"].startswith("data:image/png;base64,")
    assert f"secret={answer['secret']}" in answer["address"]
    totp = pyotp.TOTP(answer["secret"])
    wrong = await client.post(f"{API}/account/second-factor/confirm", json={"code": "000000"})
    assert (wrong.status_code, wrong.json()["code"]) == (403, "wrong_code")
    right = await client.post(f"{API}/account/second-factor/confirm", json={"code": totp.at(clock.s)})
    return totp, right.json()["codes"].split("\n")


async def sign_in(clinic: Clinic, name: str, code: str | None = None) -> httpx.Response:
    async with clinic.client() as client:
        body = {"name": name, "password": PASSWORD, "code": code}
        return await client.post(f"{API}/sign-in", json=body)


async def test_signing_in_needs_a_code_that_works_once(clinic: Clinic, clock: At) -> None:
    clinic.app.state.throttle = Throttle()
    async with clinic.client("clinician") as client:
        totp, codes = await enrol(clinic, client, clock)
        assert len(set(codes)) == 10
        assert "A code is required" in (await client.get("/account")).text
        # no second one over it
        second_response = await client.post(f"{API}/account/second-factor", json={"password": PASSWORD})
        assert second_response.status_code == 409
    with clinic.db.read() as c:
        stored = c.execute(select(table).join(user).where(user.c.name == "clinician")).one()
    assert totp.secret.encode() not in stored.secret
    assert not set(codes) & set(stored.recovery)
    assert clinic.settings.second_factor_key.stat().st_mode & 0o077 == 0
    assert (await sign_in(clinic, "clinician")).json()["code"] == "code_needed"
    used = totp.at(clock.s)
    assert (await sign_in(clinic, "clinician", used)).json()["code"] == "wrong_code"  # it proved the set-up
    clock.s += 30
    code = totp.at(clock.s)
    assert (await sign_in(clinic, "clinician", f"{code[:3]} {code[3:]}")).status_code == 200
    assert (await sign_in(clinic, "clinician", code)).status_code == 401
    clock.s += 3600
    assert (await sign_in(clinic, "clinician", totp.at(clock.s - 60))).status_code == 401
    assert (await sign_in(clinic, "clinician", totp.at(clock.s + 30))).status_code == 200  # a fast telephone
    assert (await sign_in(clinic, "clinician", totp.at(clock.s))).status_code == 401  # older than the last
    assert (await sign_in(clinic, "clinician", codes[0].lower())).status_code == 200
    assert (await sign_in(clinic, "clinician", codes[0])).status_code == 401
    async with clinic.client("admin") as admin:
        rows = (await admin.get(f"{API}/audit")).json()
    actions = [row["action"] for row in rows]
    assert "user.recovery_code_used" in actions
    assert "sign_in.failed" in actions
    factors = [row["detail"].get("factor") for row in rows if row["action"] == "sign_in"]
    assert factors[:3] == ["recovery_code", "code", "code"]  # the newest first
    # guessing: ten wrong ones, then not even the right one for a while
    for _ in range(10):
        last = await sign_in(clinic, "clinician", "123456")
    clock.s += 60
    assert last.status_code in {401, 429}
    assert (await sign_in(clinic, "clinician", totp.at(clock.s))).status_code == 429
    clinic.app.state.throttle = Throttle()
    assert (await sign_in(clinic, "clinician", totp.at(clock.s))).status_code == 200


@pytest.mark.slow
async def test_it_is_removed_by_oneself_an_administrator_or_the_console(
    clinic: Clinic, clock: At, monkeypatch: pytest.MonkeyPatch
) -> None:
    clinic.app.state.throttle = Throttle()
    async with clinic.client("assistant") as client, clinic.client("admin") as admin:
        _, codes = await enrol(clinic, client, clock)
        remove = f"{API}/account/second-factor/remove"
        assert (await client.post(remove, json={"code": "nonsense"})).status_code == 403
        assert (await client.post(remove, json={"code": codes[3]})).status_code == 204
        assert (await sign_in(clinic, "assistant")).status_code == 200
        await enrol(clinic, client, clock)
        path = f"{API}/users/{clinic.users['assistant']}/second-factor"
        assert "Remove second factor" in (await admin.get("/users")).text
        assert (await admin.delete(path)).status_code == 204
        assert (await admin.delete(path)).status_code == 404
        assert (await client.get(f"{API}/account")).status_code == 401  # sign-ins have ended
    async with clinic.client("assistant") as client:
        await enrol(clinic, client, clock)
    assert (await sign_in(clinic, "assistant")).status_code == 401
    monkeypatch.setattr("sys.stdin", io.StringIO(f"{PASSWORD}\n"))
    tell_commands(monkeypatch, clinic.settings)
    assert user_command.user("assistant", role="assistant", data_dir=clinic.settings.data_dir) == 0
    assert (await sign_in(clinic, "assistant")).status_code == 200


async def test_a_missing_key_beside_secrets_is_an_error_and_never_a_new_key(
    clinic: Clinic, clock: At, caplog: pytest.LogCaptureFixture
) -> None:
    clinic.app.state.throttle = Throttle()
    begin = f"{API}/account/second-factor"
    with clinic.db.write() as c:
        c.execute(table.delete())
    async with clinic.client("viewer") as client, clinic.client("assistant") as other_client:
        totp, codes = await enrol(clinic, client, clock)
        key = clinic.settings.second_factor_key
        stored_content = key.read_bytes()
        key.unlink()
        clock.s += 30
        for answer in (
            await sign_in(clinic, "viewer", totp.at(clock.s)),
            await other_client.post(begin, json={"password": PASSWORD}),
        ):
            assert (answer.status_code, answer.json()["code"]) == (503, "second_factor_key_unusable")
            assert str(key) not in answer.text
        assert not key.exists()
        assert str(key) in caplog.text
        assert (await sign_in(clinic, "viewer", codes[0])).status_code == 200  # a recovery code needs no key
        make_key(key)  # of another clinic
        assert (await sign_in(clinic, "viewer", totp.at(clock.s))).status_code == 503
        with clinic.db.read() as c:
            assert len(second_factor.find_problems(c, key)) == 1
        key.write_bytes(stored_content)
        with clinic.db.read() as c:
            assert second_factor.find_problems(c, key) == []
        assert (await sign_in(clinic, "viewer", totp.at(clock.s))).status_code == 200
        key.unlink()
        with clinic.db.write() as c:
            second_factor.remove(c, clinic.user("viewer"))
        assert (
            await other_client.post(begin, json={"password": PASSWORD})
        ).status_code == 200  # nobody needs the old one
        assert key.exists()
