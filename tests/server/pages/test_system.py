"""System page for administrators."""

from __future__ import annotations

import datetime as dt
import re
from pathlib import Path

import pytest

from sagittal.server.clinic.calendar_days import move_years
from sagittal.server.pages.system import describe_backups
from sagittal.server.safekeeping import backup_schedule
from sagittal.server.safekeeping.backup_schedule import BackupState, Outcome
from sagittal.server.settings import Settings, SettingsError
from sagittal.server.storage.readiness import Readiness
from sagittal.server.storage.schema.tables import now
from tests.helpers.clinic import open_clinic

pytestmark = pytest.mark.anyio
NOW = dt.datetime(2026, 3, 14, 8, tzinfo=dt.UTC)


@pytest.mark.slow
async def test_backups_restore_test_parts_and_the_end_of_the_audit_log(tmp_path: Path) -> None:
    async with (
        open_clinic(tmp_path / "home", backup_dir=str(tmp_path / "disk")) as clinic,
        clinic.client("admin") as admin,
        clinic.client("clinician") as clinician,
    ):
        assert "none yet" in (await admin.get("/system")).text
        good = Outcome(NOW, True, "sagittal-x.tar", "", 5_000_000)
        bad = Outcome(NOW, False, "sagittal-x.tar", "sagittal-x.tar is damaged.")
        backup_schedule._write(clinic.settings, BackupState(good, good, bad))
        await admin.post("/api/v1/patients", json={"code": "SY-1"})
        html = (await admin.get("/system")).text
        head = (await admin.get("/api/v1/audit/head")).json()
        assert "sagittal-x.tar is damaged." in html
        assert "5.0 MB" in html
        assert head["hash"] in html
        assert html.count("works") == 6
        assert (await clinician.get("/system")).status_code == 403
        clinic.app.state.readiness = Readiness(
            clinic.settings, clinic.db, clinic.app.state.blobs, parts={"workers": lambda: "0 of 1 run."}
        )
        ready = await admin.get("/health/ready")
        assert (ready.status_code, ready.json()["checks"]["workers"]) == (503, "0 of 1 run.")
        assert "0 of 1 run." in (await admin.get("/system")).text


async def test_what_fails_and_what_is_late_is_told() -> None:
    good = Outcome(NOW, True, "x", "")
    for days, expected in ((0.9, ["good", "good"]), (2, ["late", "good"]), (9, ["late", "late"])):
        rows = describe_backups(BackupState(good, good, good), NOW + dt.timedelta(days=days))
        assert [row["word"] for row in rows] == expected
    rows = describe_backups(
        BackupState(Outcome(NOW, False, "", "no disk"), None, Outcome(NOW, None, "x", "")), NOW
    )
    assert [row["word"] for row in rows] == ["failed", "not tested"]


async def test_every_answer_has_an_id_and_a_secure_one_forbids_plain_http(tmp_path: Path) -> None:
    async with open_clinic(tmp_path, behind_tls=True) as clinic, clinic.client() as client:
        answers = [await client.get(path) for path in ("/sign-in", "/nowhere", "/health/live")]
        assert {a.headers["strict-transport-security"] for a in answers} == {"max-age=31536000"}
        ids = {a.headers["x-request-id"] for a in answers}
        assert len(ids) == 3
        assert all(re.fullmatch(r"[0-9a-f]{16}", one) for one in ids)


async def test_who_has_not_come_for_years_is_listed(tmp_path: Path) -> None:
    async with open_clinic(tmp_path, retention_years=10) as clinic, clinic.client("admin") as admin:
        assert "None." in (await admin.get("/system")).text
        today = now().date()
        for code, visit in (("OLD", move_years(today, -11)), ("NEW", move_years(today, -9)), ("NONE", None)):
            payload = (await admin.post("/api/v1/patients", json={"code": code})).json()["id"]
            if visit is not None:
                body = {"title": "Walk", "performed_on": visit.isoformat()}
                await admin.post(f"/api/v1/patients/{payload}/sessions", json=body)
        html = (await admin.get("/system")).text
        assert "Without a visit for 10 years" in html
        assert [code for code in ("OLD", "NEW", "NONE") if f">{code}</a>" in html] == ["OLD"]
    assert move_years(dt.date(2024, 2, 29), -1) == dt.date(2023, 2, 28)
    with pytest.raises(SettingsError, match="0 to 200"):
        Settings(data_dir=tmp_path, retention_years=-1)
