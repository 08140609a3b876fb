"""A session over the API: opened, changed, described, erased."""

from __future__ import annotations

import pytest

from sagittal.server.clinic import patients, sessions
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio
API = "/api/v1"


async def test_a_session_is_opened_changed_and_removed_by_who_may(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        session = sessions.create(c, None, patients.create(c, None, code="SE-1").id, title="Walk").id
    address = f"{API}/sessions/{session}"
    async with clinic.client("clinician") as client:
        initial_body = (await client.get(address)).json()
        assert (initial_body["title"], initial_body["state"], initial_body["patient_code"]) == (
            "Walk",
            "empty",
            "SE-1",
        )
        changed = (await client.patch(address, json={"height_m": 1.7, "note": None})).json()
        assert changed == initial_body | {"height_m": 1.7, "note": ""}
        assert (await client.patch(address, json={"title": ""})).status_code == 422
        empty = [
            await client.get(f"{address}/recording"),
            await client.put(f"{address}/manifest", json={}),
            await client.post(f"{address}/inspections"),
        ]
        assert [(a.status_code, a.json()["code"]) for a in empty] == [
            (404, "not_found"), (409, "no_files"), (409, "no_files"),
        ]  # fmt: skip
    async with clinic.client("viewer") as client:
        assert (await client.get(address)).json() == changed
        assert (await client.patch(address, json={"title": "Run"})).status_code == 403
        assert (await client.delete(address)).status_code == 403
    async with clinic.client("admin") as client:
        assert (await client.delete(address)).status_code == 204
        assert [(await client.get(address)).status_code, (await client.delete(address)).status_code] == [
            404,
            404,
        ]


async def test_files_are_described_and_looked_at_once_for_the_same_wish(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        session = sessions.create(c, None, patients.create(c, None, code="SE-2").id).id
    address = f"{API}/sessions/{session}"
    async with clinic.client("assistant") as client:
        assert (await client.put(f"{address}/files/walk.txt", content=b"recording")).is_success
        first, second = [await client.post(f"{address}/inspections") for _ in range(2)]
        assert (first.status_code, first.json()["kind"]) == (202, "inspect")
        assert second.json()["id"] == first.json()["id"]
        body = (await client.get(f"{address}/recording")).json()
        assert [(f["name"], f["size"]) for f in body["files"]] == [("walk.txt", 9)]
        assert (body["manifest"], body["session_id"]) == (None, session)
        mapped = {"sensors": {"A1": "pelvis"}}
        assert (await client.put(f"{address}/manifest", json=mapped)).json()["manifest"]["sensors"] == mapped[
            "sensors"
        ]
        wrong = await client.put(f"{address}/manifest", json={"sensors": {"A1": "tail"}})
        assert wrong.status_code == 422
        assert (await client.get(f"{address}/recording")).json()["manifest"]["sensors"] == mapped["sensors"]
