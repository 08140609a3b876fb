"""Identities of patients: access, changes, and absence of names elsewhere."""

from __future__ import annotations

import io
import json
import logging
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from sagittal.server.auth import api_tokens
from sagittal.server.auth.api_tokens import Scope
from sagittal.server.sharing import signed_reports
from sagittal.server.sharing.signed_reports import DOCUMENT, PSEUDONYMISED
from sagittal.server.storage.field_cipher import make_keys
from sagittal.server.storage.schema.tables import session
from tests.helpers.clinic import Clinic, open_clinic
from tests.server import analysed, crowd

pytestmark = pytest.mark.anyio
API = "/api/v1"
CANARY = "Zzcanary"
WHO = {
    "name": f"Erika {CANARY}",
    "born_on": "1951-04-30",
    "record_number": f"R-{CANARY}",
    "insurance_number": f"A-{CANARY}",
    "contact": f"{CANARY}weg 7\n01234 567",
}


@pytest.fixture
async def ward(tmp_path: Path, anyio_backend: str) -> AsyncIterator[tuple[Clinic, str, str]]:
    """A clinic that keeps names, a patient with a walk that is analysed, and that walk."""
    async with open_clinic(tmp_path) as clinic:
        ((_, sid),) = crowd.fill(clinic, 1, 2, analysed.files())
        with clinic.db.read() as c:
            pid = c.execute(session.select().where(session.c.id == sid)).one().patient_id
        make_keys(clinic.settings.identity_key_file)
        yield clinic, pid, sid


async def test_off_until_there_is_a_key(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic, clinic.client("clinician") as client:
        pid = (await client.post(f"{API}/patients", json={"code": "P-1"})).json()["id"]
        assert "Identity" not in (await client.get(f"/patients/{pid}")).text
        for answer in (
            await client.get(f"{API}/patients/{pid}/identity"),
            await client.patch(f"{API}/patients/{pid}/identity", json=WHO),
        ):
            assert (answer.status_code, answer.json()["code"]) == (409, "identities_off")
        assert not clinic.settings.identity_key_file.exists()


async def test_written_read_changed_and_taken_away(ward: tuple[Clinic, str, str]) -> None:
    clinic, pid, _ = ward
    here = f"{API}/patients/{pid}/identity"
    async with clinic.client("clinician") as client:
        assert (await client.get(here)).json() == dict.fromkeys([*WHO, "changed_at"])
        response = await client.patch(here, json=WHO)
        assert response.status_code == 200, response.text
        assert {name: response.json()[name] for name in WHO} == WHO
        assert (await client.get(here)).json() == response.json()
        page = await client.get(f"/patients/{pid}/identity")
        assert f'value="Erika {CANARY}"' in page.text
        assert page.headers["cache-control"] == "no-store"
        assert CANARY not in (await client.get(f"/patients/{pid}")).text
        gone = await client.patch(here, json={"name": None})
        assert (gone.json()["name"], gone.json()["contact"]) == (None, WHO["contact"])
        for wrong in ({"name": "a\nb"}, {"name": "x" * 201}, {"born_on": "30.4.1951"}, {"shoe": "size 42"}):
            refused = await client.patch(here, json=wrong)
            assert refused.status_code == 422, refused.text
            assert not [v for v in wrong.values() if v in refused.text]
    async with clinic.client("admin") as client:
        rows = (await client.get(f"{API}/audit")).json()
        deeds = [row["action"] for row in rows if row["action"].startswith("identity.")]
        assert deeds.count("identity.opened") == 3
        assert deeds.count("identity.changed") == 2
        assert CANARY not in str(rows)
    for role in ("assistant", "viewer"):
        async with clinic.client(role) as client:
            assert "Identity" not in (await client.get(f"/patients/{pid}")).text
            for answer in (
                await client.get(here),
                await client.get(f"/patients/{pid}/identity"),
                await client.patch(here, json=WHO),
            ):
                assert answer.status_code == 403
                assert CANARY not in answer.text


async def test_no_token_reads_a_name(ward: tuple[Clinic, str, str]) -> None:
    clinic, pid, _ = ward
    async with clinic.client("clinician") as client:
        await client.patch(f"{API}/patients/{pid}/identity", json=WHO)
    with clinic.db.write() as c:
        _, token = api_tokens.issue(c, clinic.user("clinician"), "all", list(Scope), 9)
    async with clinic.client(headers={"Authorization": f"Bearer {token}"}) as client:
        assert (await client.get(f"{API}/patients/{pid}/identity")).status_code == 403
        assert (await client.patch(f"{API}/patients/{pid}/identity", json=WHO)).status_code == 403


@pytest.mark.slow
async def test_the_name_stands_on_paper_only_where_it_was_ticked(ward: tuple[Clinic, str, str]) -> None:
    clinic, pid, sid = ward
    here = f"/sessions/{sid}/print"
    async with clinic.client("clinician") as client:
        await client.patch(f"{API}/patients/{pid}/identity", json=WHO)
        plain = await client.get(here)
        assert "With the patient's name" in plain.text
        assert CANARY not in plain.text
        named = await client.get(here, params={"named": "true"})
        assert f"Erika {CANARY}" in named.text
        assert "report.pdf?named=true" in named.text
        assert CANARY not in (await client.get(here)).text  # nothing of it was kept
        signed = (await client.post(f"/sessions/{sid}/report/sign?named=true", json={})).json()["id"]
    with clinic.db.read() as c:
        for name in (DOCUMENT, PSEUDONYMISED):
            document = signed_reports.read_document(c, clinic.app.state.blobs, signed, name)
            assert CANARY.encode() not in document
    async with clinic.client("viewer") as client:
        visible_response = await client.get(here, params={"named": "true"})
        assert visible_response.status_code == 200
        assert CANARY not in visible_response.text
        assert "With the patient's name" not in visible_response.text
    async with clinic.client("admin") as client:
        rows = (await client.get(f"{API}/audit")).json()
        assert [r["action"] for r in rows].count("identity.printed") == 1


@pytest.mark.slow
async def test_the_export_of_one_patient_has_it_and_nothing_else_has(
    ward: tuple[Clinic, str, str], caplog: pytest.LogCaptureFixture
) -> None:
    """The canary: after all was asked once, no file of the clinic and no line of the log has the name."""
    clinic, pid, sid = ward
    caplog.set_level(logging.DEBUG)
    async with clinic.client("clinician") as client:
        await client.patch(f"{API}/patients/{pid}/identity", json=WHO)
        zipped = await client.get(f"{API}/patients/{pid}/export")
        with zipfile.ZipFile(io.BytesIO(zipped.content)) as archive:
            (row,) = json.loads(archive.read("patient.json"))["rows"]["patient_identity"]
            assert {name: row[name] for name in WHO} == WHO
            assert CANARY not in "".join(archive.namelist())
            assert CANARY.encode() not in archive.read("audit.json")
        assert CANARY not in zipped.headers["content-disposition"]
        for path in (
            f"/patients/{pid}", "/patients", f"/patients?q={CANARY[:4]}", f"/sessions/{sid}",
            f"/sessions/{sid}/print", f"/sessions/{sid}/leaflet", f"/patients/{pid}/course", "/study",
            f"{API}/patients", f"{API}/patients/{pid}", f"{API}/study.zip",
            f"/sessions/{sid}/report", f"/patients/{pid}/trends",
        ):  # fmt: skip
            answer = await client.get(path)
            assert answer.status_code == 200, path
            assert CANARY.encode() not in answer.content, path
        await client.get(f"/patients/{pid}/identity")
        await client.get(f"/sessions/{sid}/print?named=true")
        clinic.settings.identity_key_file.rename(clinic.settings.data_dir / "away")
        for path in (f"{API}/patients/{pid}/identity", f"/patients/{pid}/identity"):
            missing = await client.get(path, headers={"accept": "text/html"})
            assert missing.status_code == 503
            assert "patient names is missing" in missing.text
            assert str(clinic.settings.data_dir) not in missing.text
        with zipfile.ZipFile(
            io.BytesIO((await client.get(f"{API}/patients/{pid}/export")).content)
        ) as archive:
            assert "patient_identity" not in json.loads(archive.read("patient.json"))["rows"]
            assert b"patient names is missing" in archive.read("missing.json")
    assert CANARY not in caplog.text
    if clinic.settings.database_url:
        return  # its files are the server's; the rows are looked at in services/test_identities.py
    files = [path for path in clinic.settings.data_dir.rglob("*") if path.is_file()]
    assert {"sagittal.db", "sagittal.db-wal"} <= {path.name for path in files}
    for file in files:
        assert CANARY.encode() not in file.read_bytes(), file
        assert CANARY not in str(file)
