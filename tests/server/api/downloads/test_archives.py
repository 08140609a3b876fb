"""Download of a visit's archive."""

from __future__ import annotations

import io
import zipfile

import pytest

from sagittal.server.clinic import patients, sessions
from tests.helpers.clinic import Clinic
from tests.server import analysed

pytestmark = pytest.mark.anyio
API = "/api/v1"


async def test_a_visit_is_downloaded_whole_with_its_tables_and_that_is_a_row(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="AR-1").id
        session, empty = (sessions.create(c, None, patient).id for _ in range(2))
    done = analysed.finish(clinic, patient, session, analysed.files())
    path = f"{API}/sessions/{session}/archive.zip"
    async with clinic.client("viewer") as client:
        answer = await client.get(path)
        nothing = await client.get(f"{API}/sessions/{empty}/archive.zip")
        table = await client.get(f"{API}/sessions/{session}/parameters.csv")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/zip"
    assert answer.headers["content-disposition"] == f'attachment; filename="visit-{session[:8]}.zip"'
    assert int(answer.headers["content-length"]) == len(answer.content)
    with zipfile.ZipFile(io.BytesIO(answer.content)) as opened:
        assert opened.testzip() is None
        by_name = {name.rpartition("/")[2]: opened.read(name) for name in opened.namelist()}
    assert by_name["walk.txt"] == b"recording"
    assert by_name["parameters.csv"] == table.content
    assert by_name["analysis.json"] == analysed.files()["analysis.json"]
    assert b"AR-1" not in b"".join(by_name.values()), "the archive is of nobody known"
    assert nothing.status_code == 404
    async with clinic.client("assistant") as client:
        assert (await client.get(path)).status_code == 403
    async with clinic.client("admin") as client:
        rows = [r for r in (await client.get(f"{API}/audit")).json() if r["action"] == "archive.opened"]
    assert [(r["user_name"], r["resource_id"], r["detail"]) for r in rows] == [
        ("viewer", session, {"analysis_id": done})
    ]
