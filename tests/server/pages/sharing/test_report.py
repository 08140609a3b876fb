"""Signed reports are immutable; links expire and reach only their recipients."""

from __future__ import annotations

import ctypes.util
import datetime as dt
import hashlib
import io
import json
import re
import select
import socket
import sys
import zipfile
from pathlib import Path

import pypdfium2
import pytest
import sqlalchemy as sa

from sagittal.server.http.templates import TEMPLATES
from sagittal.server.report.pdf import PdfMissing, render_pdf
from sagittal.server.sharing import report_links
from sagittal.server.sharing.signed_reports import ASSESSMENT_CHARACTERS
from sagittal.server.storage.schema.report_tables import report_link
from sagittal.server.storage.schema.tables import audit, now
from tests.helpers.clinic import Clinic, open_clinic
from tests.server import analysed
from tests.server.pages.test_pages import page, visit

pytestmark = pytest.mark.anyio


async def sign(clinic: Clinic, session: str, role: str = "clinician") -> str:
    async with clinic.client(role) as client:
        answer = await client.post(f"/sessions/{session}/report/sign", json={})
    assert answer.status_code == 201, answer.text
    result: str = answer.json()["id"]
    return result


async def archived(clinic: Clinic, session: str) -> tuple[bytes, bool] | None:
    """The signed report in the archive of a visit, and whether its numbers are the archive's."""
    async with clinic.client("viewer") as client:
        answer = await client.get(f"/api/v1/sessions/{session}/archive.zip")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as opened:
        data = json.loads(opened.read("sagittal-episode.json"))["signed_report"]
        return None if data is None else (opened.read("report/report.html"), data["of_these_numbers"])


async def write(clinic: Clinic, session: str, text: str) -> int:
    async with clinic.client("clinician") as client:
        answer = await client.put(f"/api/v1/sessions/{session}/assessment", json={"content": text})
    return answer.status_code


@pytest.mark.slow
async def test_a_signed_report_keeps_its_bytes_while_the_page_follows(clinic: Clinic) -> None:
    _, session = await visit(clinic, "S-1")
    assert await write(clinic, session, "Walks faster.\n\nPlan: <b>longer</b> steps.") == 204
    async with clinic.client("clinician", {"accept-language": "de"}) as client:
        form = (await client.get(f"/sessions/{session}/report")).text
    # what was typed is not translated
    assert ">Walks faster.\n\nPlan: &lt;b&gt;longer&lt;/b&gt; steps.</textarea>" in form
    paper = await page(clinic, f"/sessions/{session}/print")
    assert "Plan: &lt;b&gt;longer&lt;/b&gt; steps." in paper
    assert "not signed" in paper
    report = await sign(clinic, session)
    initial = await page(clinic, f"/signed-reports/{report}")
    assert "Signed, version 1" in initial
    assert "Walks faster." in initial
    assert not re.search(r"<script|<link|href=\"/", initial)
    assert await archived(clinic, session) == (initial.encode(), True)
    # locked: neither its text nor another signature, until somebody says why
    assert await write(clinic, session, "Something else") == 409
    async with clinic.client("clinician") as client:
        second_response = await client.post(f"/sessions/{session}/report/sign", json={})
        listed = (await client.get(f"/api/v1/sessions/{session}/signed-reports")).json()
    assert second_response.json()["code"] == "report_signed"
    assert listed[0]["sha256"] == hashlib.sha256(initial.encode()).hexdigest()
    async with clinic.client("clinician") as client:
        (await client.patch(f"/api/v1/sessions/{session}", json={"title": "Another"})).raise_for_status()
        requests = {"config": {"poses": {"estimator": "kinematic"}}}
        (await client.post(f"/api/v1/sessions/{session}/analyses", json=requests)).raise_for_status()
    analysed.publish_next(clinic, session, analysed.files(14.0))
    assert await page(clinic, f"/signed-reports/{report}") == initial
    assert await archived(clinic, session) == (initial.encode(), False)
    assert "Another" in await page(clinic, f"/sessions/{session}/print")
    async with clinic.client("clinician") as client:
        empty = await client.post(f"/api/v1/signed-reports/{report}/reopen", json={"reason": " "})
        opened = await client.post(f"/api/v1/signed-reports/{report}/reopen", json={"reason": "Typing error"})
        twice = await client.post(f"/api/v1/signed-reports/{report}/reopen", json={"reason": "Typing error"})
    assert (empty.status_code, opened.status_code, twice.status_code) == (422, 200, 409)
    assert await archived(clinic, session) is None
    assert await write(clinic, session, "Walks slower.") == 204
    await sign(clinic, session)
    desk = await page(clinic, f"/sessions/{session}/report")
    assert "Version 2" in desk
    assert "Typing error" in desk
    assert await page(clinic, f"/signed-reports/{report}") == initial


async def test_an_assessment_longer_than_its_room_is_refused_and_the_earlier_one_stays(
    clinic: Clinic,
) -> None:
    _, session = await visit(clinic, "S-LONG")
    fits = "x" * ASSESSMENT_CHARACTERS
    assert await write(clinic, session, f" {fits}\n") == 204
    async with clinic.client("clinician") as client:
        path = f"/api/v1/sessions/{session}/assessment"
        refused = await client.put(path, json={"content": f"{fits}yz"})
        form = (await client.get(f"/sessions/{session}/report")).text
    assert (refused.status_code, refused.json()["code"]) == (422, "text_too_long")
    assert "has 422 characters; at most 420 fit" in refused.json()["detail"]
    assert f">{fits}</textarea>" in form
    assert 'data-limit="420"' in form


async def test_who_may_not_sign_reads_only(clinic: Clinic) -> None:
    _, session = await visit(clinic, "S-2")
    report = await sign(clinic, session)
    async with clinic.client("viewer") as client:
        tried = [
            await client.post(f"/sessions/{session}/report/sign", json={}),
            await client.put(f"/api/v1/sessions/{session}/assessment", json={"content": "x"}),
            await client.post(f"/api/v1/signed-reports/{report}/reopen", json={"reason": "x"}),
            await client.post(f"/api/v1/signed-reports/{report}/links", json={}),
        ]
    assert [t.status_code for t in tried] == [403] * 4
    assert "Signed, version 1" in await page(clinic, f"/signed-reports/{report}", "viewer")
    desk = await page(clinic, f"/sessions/{session}/report", "viewer")
    assert "sign-report" not in desk
    assert "share-report" not in desk


@pytest.mark.slow
async def test_a_link_opens_one_report_without_account_or_code_until_it_ends(clinic: Clinic) -> None:
    patient, session = await visit(clinic, "S-3-CODE")
    async with clinic.client("clinician") as client:
        changed = {"title": "Walk of Jane Doe", "note": "Jane Doe"}
        (await client.patch(f"/api/v1/sessions/{session}", json=changed)).raise_for_status()
        report = await sign(clinic, session)
        response = await client.post(f"/api/v1/signed-reports/{report}/links", json={"days": 3})
        too_long = await client.post(f"/api/v1/signed-reports/{report}/links", json={"days": 91})
    assert (response.status_code, too_long.status_code) == (201, 422)
    url, token = response.json()["url"], response.json()["url"].rpartition("/")[2]
    assert response.json()["qr"].startswith("data:image/svg+xml")
    async with clinic.client() as stranger:
        answer, second_response = await stranger.get(url), await stranger.get(url)
    assert answer.status_code == second_response.status_code == 200
    for secret in ("S-3-CODE", "Jane", patient, session, token):
        assert secret not in answer.text
    assert answer.headers["referrer-policy"] == "no-referrer"
    assert answer.headers["cache-control"] == "no-store"
    assert "noindex" in answer.headers["x-robots-tag"]
    assert answer.headers["content-security-policy"].startswith("default-src 'none'; style-src 'sha256-")
    with clinic.db.read() as c:
        stored = c.execute(sa.select(report_link)).mappings().one()
        mask = c.execute(sa.select(audit.c.action, audit.c.detail).order_by(audit.c.seq)).all()
    assert token not in str(dict(stored))
    assert token not in str(mask)
    assert [a for a, _ in mask if a.startswith("report_link.")] == ["report_link.made", "report_link.opened"]
    assert stored["openings"] == 1
    # expired, revoked, of a reopened report, never there: one answer
    with clinic.db.write() as c:
        c.execute(sa.update(report_link).values(expires_at=now() - dt.timedelta(seconds=1)))
    async with clinic.client() as stranger, clinic.client("clinician") as client:
        expired = await stranger.get(url)
        second = (await client.post(f"/api/v1/signed-reports/{report}/links", json={})).json()
        (await client.delete(f"/api/v1/report-links/{second['link']['id']}")).raise_for_status()
        revoked = await stranger.get(second["url"])
        third = (await client.post(f"/api/v1/signed-reports/{report}/links", json={})).json()
        assert (await stranger.get(third["url"])).status_code == 200
        await client.post(f"/api/v1/signed-reports/{report}/reopen", json={"reason": "Typing error"})
        reopened = await stranger.get(third["url"])
        unknown = await stranger.get("/r/" + "x" * 43)
        final_response = await client.post(f"/api/v1/signed-reports/{report}/links", json={})
    assert {a.status_code for a in (expired, revoked, reopened, unknown)} == {404}
    assert {a.json()["code"] for a in (expired, revoked, reopened, unknown)} == {"link_not_valid"}
    assert final_response.json()["code"] == "not_in_force"
    # failures are throttled, and nobody with a valid link at the same address notices
    async with clinic.client() as stranger, clinic.client("clinician") as client:
        fourth = (
            await client.post(f"/api/v1/signed-reports/{await sign(clinic, session)}/links", json={})
        ).json()
        answers = [(await stranger.get(f"/r/{n:043d}")).status_code for n in range(12)]
        assert (await stranger.get(fourth["url"])).status_code == 200
        assert (await stranger.get(revoked.url)).status_code == 429
    assert answers[-1] == 429
    # and goes with the visit
    async with clinic.client("clinician") as client:
        (await client.delete(f"/api/v1/sessions/{session}")).raise_for_status()
    with clinic.db.read() as c:
        assert report_links.of_session(c, session) == []
    async with clinic.client("clinician") as client:
        assert (await client.get(f"/signed-reports/{report}")).status_code == 404


def test_without_the_library_the_answer_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    with pytest.raises(PdfMissing, match=r"sagittal\[pdf\].*libpango") as refused:
        render_pdf("<p>Nothing</p>")
    assert refused.value.status == 404


async def test_a_server_without_the_library_offers_no_pdf(
    clinic: Clinic, monkeypatch: pytest.MonkeyPatch
) -> None:
    patient, session = await visit(clinic, "S-8")
    pages = [f"/sessions/{session}/{page}" for page in ("report", "print", "leaflet")]
    environment = TEMPLATES["en"].env
    monkeypatch.setattr(environment, "cache", None)  # a template keeps the globals it was loaded with
    async with clinic.client("clinician") as client:
        for there in (True, False):
            monkeypatch.setitem(environment.globals, "makes_pdf", there)
            for page in (*pages, f"/patients/{patient}/course"):
                answer = await client.get(page)
                assert answer.status_code == 200
                assert bool(re.search(r"href=\"[^\"]*\.pdf", answer.text)) is there, page
                assert (page != pages[0]) or (("choose PDF as the printer" in answer.text) is not there)


@pytest.mark.slow
async def test_who_asks_for_a_pdf_is_written_down_and_told_when_its_process_dies(tmp_path: Path) -> None:
    async with open_clinic(tmp_path, child_memory_bytes=1_000_000) as small:
        patient, session = await visit(small, "S-6")
        report = await sign(small, session)
        addresses = (
            f"/sessions/{session}/report.pdf",
            f"/sessions/{session}/leaflet.pdf",
            f"/patients/{patient}/course.pdf",
            f"/signed-reports/{report}/report.pdf",
        )
        async with small.client("viewer") as client:
            answers = [await client.get(address) for address in addresses]
        with small.db.read() as c:
            rows = c.execute(sa.select(audit.c.action).filter_by(user_name="viewer")).scalars().all()
    assert {a.status_code for a in answers} == {503}, answers[0].text
    assert rows == ["report.opened", "leaflet.opened", "course.opened", "signed_report.opened"]


@pytest.mark.slow
async def test_the_pdf_is_light_a4_with_its_foot_on_every_page_and_nothing_fetched(clinic: Clinic) -> None:
    if ctypes.util.find_library("pangoft2-1.0") is None:
        pytest.skip("the system library Pango is not installed")
    _, session = await visit(clinic, "S-4")
    report = await sign(clinic, session)
    async with clinic.client("clinician") as client:
        first = await client.get(f"/signed-reports/{report}/report.pdf")
        second = await client.get(f"/signed-reports/{report}/report.pdf")
        document = (await client.get(f"/signed-reports/{report}")).text
    assert first.status_code == 200, first.text
    assert first.headers["content-type"] == "application/pdf"
    assert first.content == second.content == render_pdf(document)  # kept, and the same wherever it is made
    pages = list(pypdfium2.PdfDocument(io.BytesIO(first.content)))
    for number, sheet in enumerate(pages, 1):
        assert [round(x / 72 * 25.4) for x in sheet.get_size()] == [210, 297]
        text = re.sub(r"\s+", " ", sheet.get_textpage().get_text_range())
        assert "not a medical device" in text
        assert f"{number} / {len(pages)}" in text
        picture = sheet.render(scale=0.5, grayscale=True).to_numpy()
        assert picture.mean() > 200  # light, also where the system of who prints is dark
        edge = 12  # 8.5 mm
        assert picture[:, :edge].min() > 250
        assert picture[:, -edge:].min() > 250
    with socket.create_server(("127.0.0.1", 0)) as elsewhere:
        there = f"http://127.0.0.1:{elsewhere.getsockname()[1]}/"
        asks = f'<link rel="stylesheet" href="{there}"><style>@import "{there}";</style>'
        assert render_pdf(f'<head>{asks}</head><body><img src="{there}"><img src="file:///etc/passwd">')
        assert select.select([elsewhere], [], [], 0.0)[0] == []


async def test_the_leaflet_tells_the_person_in_plain_words_what_became_of_the_last_time(
    clinic: Clinic,
) -> None:
    patient, first = await visit(clinic, "S-5")
    single = await page(clinic, f"/sessions/{first}/leaflet", "viewer")
    assert "12.0 metres in ten seconds" in single
    assert single.count("There is no earlier value to compare with.") == 3
    assert "estimate" not in single
    later = {"title": "Walk", "performed_on": "2100-01-02"}
    async with clinic.client("clinician") as client:
        session = (await client.post(f"/api/v1/patients/{patient}/sessions", json=later)).json()["id"]
        analysed.finish(clinic, patient, session, slower())
        german = (await client.get(f"/sessions/{session}/leaflet", headers={"accept-language": "de"})).text
        refused = await client.get(f"/patients/{'0' * 32}/course")
    leaflet = await page(clinic, f"/sessions/{session}/leaflet", "viewer")
    assert "6.0 metres in ten seconds" in leaflet
    assert re.search(r"Last time, on \d+ \w+ 20\d\d: 12.0 metres in ten seconds", leaflet)
    assert "This is slower than last time." in leaflet
    assert "This is about the same as last time." in leaflet  # the step was as long
    assert "6,0 Meter in zehn Sekunden" in german
    assert "Das ist langsamer als letztes Mal." in german
    # and over all visits, with the measurement error
    course = await page(clinic, f"/patients/{patient}/course", "viewer")
    assert "2 Jan 2100" in course
    assert "within measurement error" in course
    assert refused.status_code == 404


def slower() -> dict[str, bytes]:
    """The same walk at half its speed."""
    files = dict(analysed.files())
    data = json.loads(files["analysis.json"])
    for row in data["parameters"]:
        if row["name"] == "gait_speed_mps":
            row["mean"] /= 2.0
    files["analysis.json"] = json.dumps(data).encode()
    return files
