"""Text, signed versions and links of a report over the API."""

from __future__ import annotations

import datetime as dt

import pytest

from sagittal.server.clinic import patients, sessions
from sagittal.server.sharing import signed_reports
from sagittal.server.sharing.report_links import USUAL_DAYS
from sagittal.server.sharing.signed_reports import ASSESSMENT_CHARACTERS, DOCUMENT, PSEUDONYMISED
from sagittal.server.storage.schema.tables import new_id
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio
API = "/api/v1"


async def test_a_report_is_written_locked_shared_and_reopened(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="SI-1").id
        session = sessions.create(c, None, patient).id
    text, signed = f"{API}/sessions/{session}/assessment", f"{API}/sessions/{session}/signed-reports"
    report, blobs = new_id(), clinic.app.state.blobs
    async with clinic.client("clinician") as client:
        assert (await client.put(text, json={"content": " Walks faster. "})).status_code == 204
        with clinic.db.read() as c:
            assert signed_reports.read_assessment(c, session) == "Walks faster."
        long = await client.put(text, json={"content": "x" * (ASSESSMENT_CHARACTERS + 1)})
        assert (long.status_code, long.json()["code"]) == (422, "text_too_long")
        stored = {name: blobs.put(patient, b"<p>Signed</p>") for name in (DOCUMENT, PSEUDONYMISED)}
        with clinic.db.write() as c:
            signature = signed_reports.prepare_signature(c, session, report, "Anna")
            signed_reports.keep_signed(c, None, signature, session, new_id(), "en", stored)
        assert [(r["id"], r["number"]) for r in (await client.get(signed)).json()] == [(report, 1)]
        assert (await client.put(text, json={"content": None})).json()["code"] == "report_signed"
        response = await client.post(f"{API}/signed-reports/{report}/links", json={})
        assert response.status_code == 201, response.text
        url = response.json()["url"]
        assert url.startswith("http://127.0.0.1/r/")
        assert response.json()["qr"].startswith("data:image/svg+xml")
        link = response.json()["link"]
        begins, ends = (dt.datetime.fromisoformat(link[k]) for k in ("made_at", "expires_at"))
        assert ends - begins == dt.timedelta(days=USUAL_DAYS)
        listed = await client.get(f"{API}/sessions/{session}/report-links")
        assert listed.json() == [link]
        assert url.rsplit("/", 1)[1] not in listed.text
        async with clinic.client() as reader:
            assert (await reader.get(url)).status_code == 200
            assert (await client.delete(f"{API}/report-links/{link['id']}")).json()["id"] == link["id"]
            assert (await reader.get(url)).status_code == 404
        reopen = f"{API}/signed-reports/{report}/reopen"
        assert (await client.post(reopen, json={"reason": " "})).status_code == 422
        opened = await client.post(reopen, json={"reason": "Wrong side."})
        assert (opened.status_code, opened.json()["id"]) == (200, report)
        assert (await client.post(reopen, json={"reason": "Again."})).status_code == 409
        late = await client.post(f"{API}/signed-reports/{report}/links", json={"days": 1})
        assert late.status_code == 409
        assert (await client.put(text, json={"content": None})).status_code == 204
        with clinic.db.read() as c:
            assert signed_reports.read_assessment(c, session) == ""
    async with clinic.client("viewer") as client:
        assert len((await client.get(signed)).json()) == 1
        assert (await client.put(text, json={"content": "x"})).status_code == 403
