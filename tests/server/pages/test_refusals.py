"""Refusals of services are translated on German pages, with their values."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from sqlalchemy import Connection

from sagittal.server.auth.roles import Role
from sagittal.server.clinic import consents, notes, patients, sessions
from sagittal.server.errors import NotFound, ServiceError
from sagittal.server.sharing import report_links
from sagittal.server.storage.db import Database
from sagittal.web.language import LANGUAGES, SOURCE, load_catalogue, script_texts
from tests.helpers.clinic import open_clinic

pytestmark = pytest.mark.anyio


def _refuse(c: Connection, patient: str) -> list[ServiceError]:
    """Refusals as the services make them, each of another form."""
    result = []
    for attempt in (
        lambda: patients.get(c, "0" * 32),
        lambda: report_links.get(c, "0" * 32),
        lambda: patients.create(c, None, code="P-1"),
        lambda: patients.change(c, None, patient, {"birth_year": 2999}),
        lambda: notes.add(c, None, patient, " "),
        lambda: consents.give(c, None, patient, purpose="research", evidence=""),
        lambda: sessions.create(c, None, patient, height_m=3.0),
    ):
        with pytest.raises(ServiceError) as refused:
            attempt()
        result.append(refused.value)
    return result


def test_every_language_says_the_common_refusals(source: Path | str) -> None:
    db = Database(source)
    with db.write() as c:
        refuse = _refuse(c, patients.create(c, None, code="P-1").id)
    db.close()
    for language in set(LANGUAGES) - {SOURCE}:
        catalogue, scripts = load_catalogue(language), script_texts(language)[1].decode()
        for error in refuse:
            text = catalogue.find(error.message)
            assert text is not None, error.message
            # what was given stands in it, and nothing of the English does
            for value in re.findall(r"\b(?:P-1|0{32}|2999|200)\b", error.message):
                assert value in text
            assert not re.search(r"\b(the|expected|patient|belongs|been)\b", text), text
        assert "gehört einem anderen Patienten" in scripts or language != "de"


async def test_the_page_of_a_refusal_is_german(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic, clinic.client(Role.CLINICIAN) as client:
        address = f"/patients/{'0' * 32}"
        expected = {"accept": "text/html", "accept-language": "de"}
        german = await client.get(address, headers=expected)
        english = await client.get(address, headers=expected | {"accept-language": "en"})
    message = NotFound("patient", "0" * 32).message
    assert (german.status_code, english.status_code) == (404, 404)
    assert message.split(",")[1] in english.text
    assert "Nicht vorhanden oder gelöscht: Patient" in german.text
    assert "has been deleted" not in german.text


async def test_an_address_cut_short_has_nothing_and_says_so(tmp_path: Path) -> None:
    async with open_clinic(tmp_path) as clinic, clinic.client(Role.CLINICIAN) as client:
        page = await client.get("/sessions/0123abc", headers={"accept": "text/html"})
        program = await client.get("/api/v1/sessions/0123abc")
    assert page.status_code == 404
    assert "Nothing exists at this address" in page.text
    assert "pattern" not in page.text
    assert program.json()["code"] == "invalid_request"
