"""Texts of the audit page for all audit entries."""

from __future__ import annotations

import re

import pytest

from sagittal.server.auth.accounts import Factor
from sagittal.server.pages.audit_words import DEEDS, SIGNED_IN_BY, describe_deed
from sagittal.server.results.reviews import ACTIONS
from tests.data import ROOT
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


def test_whatever_is_written_down_has_words() -> None:
    verbs = "|".join(sorted({action.partition(".")[2] for action in DEEDS} - {""}))
    source = "\n".join(p.read_text() for p in (ROOT / "server").rglob("*.py") if p.name != "audit_words.py")
    written = set(re.findall(rf'"([a-z_]+\.(?:{verbs}))"', source)) | set(ACTIONS.values())
    written |= {f"{r}.opened" for r in re.findall(r'record_opening\(request, who, "(\w+)"', source)}
    written |= {f"{r}.listed" for r in re.findall(r'record_listing\(request, who, "(\w+)"', source)}
    assert len(written) > 60
    assert written <= set(DEEDS)


def test_what_has_no_words_shows_its_own_name() -> None:
    assert describe_deed("tea_pot.filled") == "tea pot: filled"


async def test_rows_name_the_patient_and_the_visit_while_they_exist(clinic: Clinic) -> None:
    async with clinic.client("admin") as client:
        patient = (await client.post("/api/v1/patients", json={"code": "AU-1"})).json()["id"]
        response = await client.post(
            f"/api/v1/patients/{patient}/sessions", json={"title": "Walk", "performed_on": "2026-03-02"}
        )
        html = (await client.get("/audit")).text
        message = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", html))
        assert "admin added the visit: AU-1, 2 Mar 2026" in message
        assert "admin added the patient: AU-1" in message
        assert f'href="/sessions/{response.json()["id"]}"' in html
        (await client.delete(f"/api/v1/patients/{patient}?confirm=AU-1")).raise_for_status()
        html = (await client.get("/audit")).text
    assert "AU-1" not in html
    assert "deleted the patient with all recordings" in html


def test_a_sign_in_says_by_which_factor() -> None:
    assert set(SIGNED_IN_BY) == set(Factor)
    assert describe_deed("sign_in", {"factor": "code"}) == "signed in with password and code"
    assert describe_deed("sign_in", {}) == "signed in"  # a row from before
