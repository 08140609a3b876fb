from __future__ import annotations

import contextlib
import logging
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text

from sagittal.core.errors import SagittalError, SignalError
from sagittal.server.auth.access import require
from sagittal.server.auth.roles import Action
from sagittal.server.errors import NotFound
from sagittal.server.http.problems import Problem, as_problem
from sagittal.server.storage import sqlite_file
from tests.helpers.clinic import Clinic, open_clinic
from tests.helpers.marks import sqlite_only

pytestmark = pytest.mark.anyio

API = "/api/v1"
CANARY = "Zzyzx-Canary"


def test_codes_of_core_and_of_use_cases_become_problems() -> None:
    bad = as_problem(SignalError("no_rest", "No rest was found. Record 3 s of standing."))
    assert (bad.status, bad.code) == (422, "no_rest")
    assert as_problem(NotFound("job", "x")).status == 404
    hidden = as_problem(RuntimeError(f"secret of {CANARY}"))
    assert (hidden.status, hidden.code) == (500, "internal_error")
    assert CANARY not in str(hidden.to_json())


async def test_a_problem_has_the_members_of_rfc_9457_and_a_code(clinic: Clinic) -> None:
    async with clinic.client() as client:
        answer = await client.get(f"{API}/patients")
    assert answer.status_code == 401
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert set(problem) == {"type", "title", "status", "detail", "code"}
    assert (problem["status"], problem["code"]) == (401, "not_signed_in")


async def test_a_browser_gets_a_page_and_is_led_to_sign_in(clinic: Clinic) -> None:
    page = {"Accept": "text/html,application/xhtml+xml"}
    async with clinic.client(headers=page) as client:
        answer = await client.get("/patients?q=a b")
        assert (answer.status_code, answer.headers["location"]) == (
            303,
            "/sign-in?next=/patients%3Fq%3Da%2520b",
        )
    async with clinic.client("viewer", headers=page) as client:
        missing = await client.get(f"/sessions/{'0' * 32}")
        assert missing.status_code == 404
        assert missing.headers["content-type"].startswith("text/html")
        refused = await client.get("/users")
        assert refused.status_code == 403
        assert "administrator" in refused.text
        data = await client.get(f"{API}/users")
        assert data.headers["content-type"] == "application/problem+json"


async def test_a_method_that_is_not_offered_says_which_are(clinic: Clinic) -> None:
    async with clinic.client("admin") as client:
        answer = await client.put(f"{API}/patients")
    assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed")
    assert answer.headers["allow"] == "GET, POST"


@pytest.fixture
def broken(clinic: Clinic) -> Any:
    """A route that fails in ways we did not foresee, with a patient's data at hand."""

    @clinic.app.get("/api/v1/broken/{kind}", dependencies=[require(Action.CHECK_HEALTH)])
    def fail(kind: str) -> None:
        if kind == "database":
            with clinic.db.write() as c:
                c.execute(
                    text("INSERT INTO patient (id, code) VALUES (:id, :code)"), {"id": "x", "code": CANARY}
                )
        if kind == "known":
            raise SagittalError("odd", "Something odd was found. Try another file.")
        raise Problem(418, "teapot", "This is a teapot.", headers={"X-Kind": kind})

    yield
    clinic.app.router.routes.pop()


async def test_an_unforeseen_error_tells_neither_client_nor_log_whose_data_it_was(
    clinic: Clinic, broken: None, caplog: pytest.LogCaptureFixture
) -> None:
    async with clinic.client(raises=False) as client:
        answer = await client.get(f"{API}/broken/database")
        assert (answer.status_code, answer.json()["code"]) == (500, "internal_error")
        assert "default-src" in answer.headers["content-security-policy"]
        assert answer.headers["x-request-id"]
        assert (await client.get(f"{API}/broken/known")).json()["code"] == "odd"
        teapot = await client.get(f"{API}/broken/x")
        assert (teapot.status_code, teapot.headers["x-kind"]) == (418, "x")
    assert CANARY not in answer.text
    async with clinic.client() as client:
        with pytest.raises(Exception, match=r"(?i)not.null") as raised:  # what the server's log gets
            await client.get(f"{API}/broken/database")
    assert CANARY not in str(raised.value)
    assert CANARY not in caplog.text


@sqlite_only
async def test_a_busy_database_is_said_and_not_an_internal_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite_file, "BUSY_TIMEOUT_MS", 100)
    async with open_clinic(tmp_path) as clinic, clinic.client("clinician") as client:
        with contextlib.closing(
            sqlite3.connect(clinic.settings.database, isolation_level=None)
        ) as other_connection:
            other_connection.execute("BEGIN IMMEDIATE")
            answer = await client.post(f"{API}/patients", json={"code": "waits"})
            other_connection.execute("ROLLBACK")
        assert (answer.status_code, answer.json()["code"]) == (503, "database_busy")
        assert answer.headers["retry-after"]
        assert (await client.post(f"{API}/patients", json={"code": "waits"})).status_code == 201


async def test_no_log_line_and_no_error_body_holds_what_was_entered_about_a_patient(
    clinic: Clinic, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    for name in ("httpx", "httpcore"):  # the client's own log is not the server's
        logging.getLogger(name).setLevel(logging.WARNING)
    async with clinic.client("clinician") as client:
        response = await client.post(f"{API}/patients", json={"code": "canary", "note": CANARY})
        patient = response.json()["id"]
        session = (await client.post(f"{API}/patients/{patient}/sessions", json={"title": CANARY})).json()[
            "id"
        ]
        await client.put(f"{API}/sessions/{session}/files/{CANARY}.csv", content=CANARY.encode())
        bodies = [
            await client.post(f"{API}/patients", json={"code": "canary"}),
            await client.post(f"{API}/patients", json={"code": "other", "sex": CANARY}),
            await client.post(f"{API}/patients", json={"code": "other", "birth_year": CANARY}),
            await client.post(f"{API}/patients", json={"code": f"{CANARY}\n"}),
            await client.patch(f"{API}/patients/{patient}", json={"height_m": 9}),
            await client.patch(f"{API}/sessions/{session}", json={"protocol": CANARY}),
            await client.put(f"{API}/sessions/{session}/manifest", json={"sensors": {"x": 1}}),
            await client.get(f"{API}/sessions/{session}/report"),
            await client.delete(f"{API}/patients/{patient}", params={"confirm": "wrong"}),
            await client.get(f"{API}/patients", params={"limit": CANARY}),
        ]
    assert [b.status_code for b in bodies if b.status_code < 400] == []
    assert [b.text for b in bodies if CANARY in b.text] == []
    assert CANARY not in caplog.text
