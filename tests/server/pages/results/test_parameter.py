"""The page that opens a number."""

from __future__ import annotations

import re

import pytest

from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server.clinic import patients, sessions
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio


async def test_a_number_has_its_definition_and_a_row_for_every_stride(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="PA-1").id
        session, empty = (sessions.create(c, None, patient).id for _ in range(2))
    analysed.finish(clinic, patient, session, analysed.files())
    async with clinic.client("viewer") as client:
        page = (await client.get(f"/sessions/{session}/parameters/stance_pct")).text
        payload = (await client.get(f"/api/v1/sessions/{session}/parameters/stance_pct")).json()
        for path in (f"{session}/parameters/nothing_such", f"{empty}/parameters/stance_pct"):
            assert (await client.get(f"/sessions/{path}")).status_code in {303, 404}, path
        assert (await client.get(f"/sessions/{session}/parameters/A")).status_code == 422
    assert CATALOGUE["stance_pct"].label in page
    assert payload["definition"].split(".")[0] in page
    body = page[page.index("Every stride") :]
    body = body[body.index("<tbody") : body.index("</tbody>")]
    assert len(re.findall(r"<tr\b", body)) == len(payload["strides"]) > 10
    async with clinic.client("admin") as client:
        rows = (await client.get("/api/v1/audit")).json()
    assert [r["resource_id"] for r in rows if r["action"] == "session.opened"] == [session]
    async with clinic.client("assistant") as client:
        assert (await client.get(f"/sessions/{session}/parameters/stance_pct")).status_code == 403
