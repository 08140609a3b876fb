"""Where pages lead to names, and when paper bears one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.clinic import identities, patients
from sagittal.server.pages.clinic.identity import name_on_paper, offers_identity
from sagittal.server.storage.field_cipher import make_keys
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


def who(clinic: Clinic, role: str) -> Identity:
    return Identity(clinic.user(role), role, "", Role(role), "")


async def test_a_name_is_on_paper_only_if_asked_for_by_who_may_and_that_is_a_row(clinic: Clinic) -> None:
    settings, trail = clinic.settings, clinic.app.state.trail
    request: Any = SimpleNamespace(app=clinic.app)
    with clinic.db.write() as c:
        patient = patients.create(c, None, code="ID-1").id

    def printed(role: str, *, named: bool) -> tuple[bool, str | None]:
        result = name_on_paper(request, clinic.db, settings, who(clinic, role), patient, named=named)
        return result["may_name"], result["person"].name if result["person"] else None

    assert not offers_identity(settings)
    assert printed("clinician", named=True) == (False, None)
    async with clinic.client("clinician") as client:
        off = await client.get(f"/patients/{patient}/identity")
    assert off.status_code == 409
    make_keys(settings.identity_key_file)
    assert offers_identity(settings)
    with clinic.db.write() as c:
        identities.change(c, settings.identity_key_file, None, patient, {"name": "Erika"})
    assert printed("clinician", named=False) == (True, None)
    assert printed("viewer", named=True)[1] is None
    assert printed("clinician", named=True) == (True, "Erika")
    async with clinic.client("clinician") as client:
        page = await client.get(f"/patients/{patient}/identity")
    assert 'value="Erika"' in page.text
    async with clinic.client("admin") as client:
        rows = (await client.get("/api/v1/audit")).json()
    looks = [
        r["action"] for r in rows if r["action"].startswith("identity.") and r["user_name"] == "clinician"
    ]
    assert looks == ["identity.opened", "identity.printed"]
    assert trail is clinic.app.state.trail


def test_a_key_that_is_named_and_missing_is_offered_too(tmp_path: Path) -> None:
    settings: Any = SimpleNamespace(identity_key="elsewhere", identity_key_file=tmp_path / "none")
    assert offers_identity(settings)
    settings.identity_key = ""
    assert not offers_identity(settings)
