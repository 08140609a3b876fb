from __future__ import annotations

import re

import pytest

from sagittal.server import audit
from sagittal.server.api.documents import openapi
from tests.helpers.clinic import Clinic
from tests.helpers.engines import on_both_engines

pytestmark = [pytest.mark.anyio, on_both_engines]

API = "/api/v1"


async def test_a_patient_is_made_changed_found_and_deleted_with_everything(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        body = {"code": "P-0001", "sex": "female", "birth_year": 1960, "height_m": 1.68}
        post = await client.post(f"{API}/patients", json=body)
        assert post.status_code == 201
        patient = post.json()
        assert {k: patient[k] for k in body} == body
        path = f"{API}/patients/{patient['id']}"
        changed = await client.patch(path, json={"note": "uses a stick", "height_m": None})
        assert changed.json() == patient | {"note": "uses a stick", "height_m": None}
        assert (await client.patch(path, json={"note": None})).json()["note"] == ""
        response = await client.get(f"{API}/patients", params={"q": "p-00"})
        assert [p["id"] for p in response.json()] == [patient["id"]]
        session = (await client.post(f"{path}/sessions", json={"title": "Barefoot"})).json()
        assert session["patient_code"] == "P-0001"
        stored = await client.put(f"{API}/sessions/{session['id']}/files/a.txt", content=b"some bytes")
        assert stored.status_code == 201
        files = [p for p in clinic.settings.blobs.rglob("*") if p.is_file()]
        assert len(files) == 1
        refused = await client.delete(path, params={"confirm": "P-0002"})
        assert (refused.status_code, refused.json()["code"]) == (409, "not_confirmed")
        assert (await client.delete(path, params={"confirm": "P-0001"})).status_code == 204
        for gone in (path, f"{API}/sessions/{session['id']}"):
            answer = await client.get(gone)
            assert (answer.status_code, answer.json()["code"]) == (404, "not_found")
    assert not any(p.is_file() for p in clinic.settings.blobs.rglob("*"))


async def test_codes_that_look_alike_belong_to_one_patient(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        assert (await client.post(f"{API}/patients", json={"code": "RACE-1"})).status_code == 201
        for alike in ("race-1", "\uff32ace-1"):
            second_response = await client.post(f"{API}/patients", json={"code": alike})
            assert (second_response.status_code, second_response.json()["code"]) == (409, "code_taken"), alike
        for hidden in ("RACE\u200b-1", "RACE\u202e-2"):
            assert (await client.post(f"{API}/patients", json={"code": hidden})).status_code == 422, hidden
        other_body = (await client.post(f"{API}/patients", json={"code": "RACE-2"})).json()["id"]
        assert (
            await client.patch(f"{API}/patients/{other_body}", json={"code": "race-2"})
        ).status_code == 200
        assert (
            await client.patch(f"{API}/patients/{other_body}", json={"code": "race-1"})
        ).status_code == 409
        turned = await client.patch(f"{API}/patients/{other_body}", json={"note": "left \u202e right"})
        assert turned.status_code == 422
        assert (
            await client.patch(f"{API}/patients/{other_body}", json={"note": "a\x00b"})
        ).status_code == 422
        assert (await client.patch(f"{API}/patients/{other_body}", json={"note": "a\nb"})).status_code == 200
        born = await client.patch(f"{API}/patients/{other_body}", json={"birth_year": 2200})
        assert born.status_code == 422


async def test_a_code_belongs_to_one_patient(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        assert (await client.post(f"{API}/patients", json={"code": "Twice"})).status_code == 201
        second_response = await client.post(f"{API}/patients", json={"code": "Twice"})
    assert (second_response.status_code, second_response.json()["code"]) == (409, "code_taken")


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"code": ""},
        {"code": " padded"},
        {"code": "two\nlines"},
        {"code": "x" * 65},
        {"code": "ok", "sex": "unknown"},
        {"code": "ok", "birth_year": 1700},
        {"code": "ok", "height_m": 178},
        {"code": "ok", "heigth_m": 1.78},
        [],
        None,
    ],
)
async def test_bad_fields_are_named_and_nothing_is_stored(clinic: Clinic, body: object) -> None:
    async with clinic.client("clinician") as client:
        initial_count = len((await client.get(f"{API}/patients")).json())
        answer = await client.post(f"{API}/patients", json=body)
        assert answer.status_code == 422
        problem = answer.json()
        assert problem["code"] == "invalid_request"
        assert problem["errors"]
        assert len((await client.get(f"{API}/patients")).json()) == initial_count


@pytest.mark.parametrize(
    "body",
    [
        b'{"code": "x", "note": "\\ud800"}',
        b'{"\\ud800": 1, "\\ud800": 2}',
        b'{"height_m": 1' + 5000 * b"0" + b"}",
        b"{",
        b"\xff",
        b"[" * 100_000,
    ],
)
async def test_what_is_no_json_is_refused(clinic: Clinic, body: bytes) -> None:
    async with clinic.client("clinician") as client:
        answer = await client.post(
            f"{API}/patients", content=body, headers={"Content-Type": "application/json"}
        )
    assert answer.status_code in {400, 422}
    assert answer.headers["content-type"] == "application/problem+json"


async def test_a_member_given_twice_is_refused_and_named(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        answer = await client.post(
            f"{API}/patients",
            content=b'{"code": "twice-1", "code": "twice-2"}',
            headers={"Content-Type": "application/json"},
        )
    assert answer.status_code == 422
    assert "the key 'code' is given twice" in answer.json()["detail"]


@pytest.mark.slow
async def test_every_operation_that_takes_json_reads_it_strictly(clinic: Clinic) -> None:
    refused = {}
    async with clinic.client("admin") as client:
        for path, item in openapi(clinic.app)["paths"].items():
            for method, operation in item.items():
                if "application/json" in operation.get("requestBody", {}).get("content", {}):
                    address = re.sub(r"{\w+}", "0" * 32, path)
                    kind = {"Content-Type": "application/json"}
                    answer = await client.request(method, address, content=b'{"a":1,"a":1}', headers=kind)
                    refused[f"{method} {path}"] = "the key 'a' is given twice" in answer.text
    assert all(refused.values()), [name for name, well in refused.items() if not well]
    assert len(refused) > 15


async def test_every_opened_and_changed_resource_is_one_audit_row_with_its_person(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        patient = (await client.post(f"{API}/patients", json={"code": "audited"})).json()["id"]
        await client.get(f"{API}/patients/{patient}")
        await client.patch(f"{API}/patients/{patient}", json={"note": "x"})
        session = (await client.post(f"{API}/patients/{patient}/sessions", json={})).json()["id"]
        await client.get(f"{API}/sessions/{session}")
        await client.patch(f"{API}/sessions/{session}", json={"note": "y"})
        await client.delete(f"{API}/sessions/{session}")
        await client.delete(f"{API}/patients/{patient}", params={"confirm": "audited"})
    async with clinic.client("admin") as client:
        rows = (await client.get(f"{API}/audit", params={"limit": 1000})).json()
    mine = [r for r in reversed(rows) if r["resource_id"] in {patient, session}]
    assert [r["action"] for r in mine] == [
        "patient.created",
        "patient.opened",
        "patient.changed",
        "session.created",
        "session.opened",
        "session.changed",
        "session.erased",
        "patient.erased",
    ]
    assert {r["user_name"] for r in mine} == {"clinician"}
    with clinic.db.read() as c:
        assert audit.find_problems(c) == []


async def test_the_audit_log_pages_backwards(clinic: Clinic) -> None:
    async with clinic.client("admin") as client:
        for i in range(4):
            await client.post(f"{API}/patients", json={"code": f"page {i}"})
        first = (await client.get(f"{API}/audit", params={"limit": 2})).json()
        second = (await client.get(f"{API}/audit", params={"limit": 2, "before": first[-1]["seq"]})).json()
    seqs = [row["seq"] for row in first + second]
    assert seqs == list(range(seqs[0], seqs[0] - 4, -1))


async def test_a_session_takes_defaults_and_refuses_unknown_protocols(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        patient = (await client.post(f"{API}/patients", json={"code": "visits"})).json()["id"]
        path = f"{API}/patients/{patient}/sessions"
        session = (await client.post(path, json={})).json()
        assert (session["protocol"], session["state"]) == ("walk", "empty")
        later = await client.post(path, json={"performed_on": "2099-01-01", "title": "Later"})
        assert next(s["title"] for s in (await client.get(path)).json()) == later.json()["title"]
        assert (await client.post(path, json={"protocol": "swimming"})).status_code == 422
        assert (await client.get(f"{API}/patients/{'0' * 32}/sessions")).status_code == 404
