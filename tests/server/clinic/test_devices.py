"""The clinic's sensors: kept with the analysis, gone with the recording, remembered, silent about people."""

from __future__ import annotations

import datetime as dt
from collections.abc import AsyncIterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sqlalchemy import func, select

from sagittal.core.frames import GRAVITY
from sagittal.core.quality.device_course import follow_device
from sagittal.core.quality.devices import DeviceCheck
from sagittal.server.clinic import devices, patients, sessions
from sagittal.server.clinic.devices import recall_places
from sagittal.server.report.words.device_words import judge_device
from sagittal.server.safekeeping import erasure
from sagittal.server.storage.schema.tables import device_check, now
from sagittal.server.uploads import receiving, recordings
from tests.helpers.clinic import Clinic, open_clinic
from tests.server.pages.uploads.test_upload import device

pytestmark = pytest.mark.anyio

LEFT, RIGHT, SPARE = "00B42991", "00B42992", "00B4299A"
TODAY = now().date()
CODE = "SECRET-PERSON"


@pytest.fixture
async def clinic(tmp_path: Path) -> AsyncIterator[Clinic]:
    async with open_clinic(tmp_path, live_workers=0) as running:
        yield running


def check(device_id: str, bias_dps: float = 0.0) -> DeviceCheck:
    bias = np.radians([0.0, bias_dps, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    return DeviceCheck(device_id, 100.0, (1.0, 9.0), bias, 0.002, up, GRAVITY, 2e-4, 1e-3)


def visit(clinic: Clinic, *, code: str = CODE, days_ago: int = 0) -> str:
    """A session with a file; its id."""
    with clinic.db.write() as c:
        known_by_code = {p.code: p.id for p in patients.list_patients(c, None)}
        pid = known_by_code.get(code) or patients.create(c, None, code=code).id
        sid = sessions.create(c, None, pid, performed_on=TODAY - dt.timedelta(days=days_ago)).id
    state = clinic.app.state
    with receiving.receive(clinic.db, state.blobs, clinic.settings, None, sid, "walk.txt") as upload:
        upload.write(b"x")
        upload.keep()
    return sid


def publish(
    clinic: Clinic, sid: str, segments: Mapping[str, str], *, exchanged: bool = False, bias_dps: float = 0.0
) -> None:
    """Publish an analysis's device checks."""
    result = [
        {**check(d, bias_dps).to_json(), "segment": segment, "exchanged": exchanged}
        for d, segment in segments.items()
    ]
    with clinic.db.write() as c:
        devices.keep_checks(c, recordings.require_current(c, sid).id, result)


def places(clinic: Clinic, *ids: str, but: str | None = None) -> dict[str, str]:
    with clinic.db.read() as c:
        return dict(recall_places(c, ids, but=but).segments)


def count(clinic: Clinic) -> int:
    with clinic.db.read() as c:
        return c.execute(select(func.count()).select_from(device_check)).scalar_one()


async def test_a_bias_that_moved_is_said_in_page_and_api_and_nobody_is_named(clinic: Clinic) -> None:
    for days_ago, bias in ((20, 0.1), (10, 0.0), (1, 1.2)):
        publish(clinic, visit(clinic, days_ago=days_ago), {LEFT: "foot_l"}, bias_dps=bias)
    publish(clinic, visit(clinic), {RIGHT: "foot_r"})
    async with clinic.client("assistant") as client:
        answers = [
            await client.get(path)
            for path in (
                "/sensors",
                f"/sensors/{LEFT}",
                "/api/v1/devices",
                f"/api/v1/devices/{LEFT}",
                "/api/v1/devices.csv",
            )
        ]
        unknown = await client.get("/sensors/00B4FFFF")
    assert [a.status_code for a in answers] == [200] * 5
    assert unknown.status_code == 404
    page, one, listed, notices, table = answers
    assert "Bias moved by 1.1 °/s" in page.text
    assert "Let it warm up" in page.text
    assert "First check" in page.text
    assert one.text.count("<svg") >= 4
    assert [d["device_id"] for d in listed.json()] == [RIGHT, LEFT]
    assert (notices.json()["state"], notices.json()["takes"], notices.json()["last_segment"]) == (
        "changed",
        3,
        "foot_l",
    )
    assert [round(k["gyro_bias_rad_s"][1], 3) for k in notices.json()["checks"]] == [0.002, 0.0, 0.021]
    assert table.text.count("\n") == 5
    with clinic.db.read() as c:
        (person,) = patients.list_patients(c, None)
        ids = {person.id, *(s.id for s in sessions.of_patient(c, person.id))}
    for a in answers:
        assert CODE not in a.text
        assert not [i for i in ids if i in a.text]


async def test_the_page_without_sensors_says_what_will_be_there(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        assert "No sensors yet" in (await client.get("/sensors")).text


async def test_a_place_is_that_of_the_last_take_and_a_segment_has_one_sensor(clinic: Clinic) -> None:
    publish(clinic, visit(clinic, days_ago=400), {SPARE: "pelvis"})
    assert places(clinic, SPARE) == {}, "too long ago"
    publish(clinic, visit(clinic, days_ago=30), {LEFT: "foot_r", RIGHT: "foot_l", SPARE: "pelvis"})
    publish(clinic, visit(clinic, code="ANOTHER", days_ago=3), {LEFT: "foot_l", RIGHT: "foot_r"})
    assert places(clinic, LEFT, RIGHT, SPARE) == {LEFT: "foot_l", RIGHT: "foot_r", SPARE: "pelvis"}
    last = visit(clinic, days_ago=1)
    publish(clinic, last, {SPARE: "foot_l"})
    assert places(clinic, LEFT, RIGHT, SPARE) == {SPARE: "foot_l", RIGHT: "foot_r"}
    assert places(clinic, LEFT, but=last) == {LEFT: "foot_l"}
    publish(clinic, visit(clinic), {LEFT: "foot_r", RIGHT: "foot_l"}, exchanged=True)
    assert places(clinic, LEFT, RIGHT) == {LEFT: "foot_l", RIGHT: "foot_r"}, "a take with sensors exchanged"


async def test_another_analysis_of_a_session_takes_the_place_of_the_first(clinic: Clinic) -> None:
    sid = visit(clinic)
    publish(clinic, sid, {LEFT: "foot_l", RIGHT: "foot_r"})
    publish(clinic, sid, {LEFT: "foot_r"})
    assert (count(clinic), places(clinic, LEFT, RIGHT)) == (1, {LEFT: "foot_r"})


@pytest.mark.parametrize("whole", [False, True])
async def test_what_a_take_said_of_sensors_goes_with_it(clinic: Clinic, whole: bool) -> None:
    sid, retained = visit(clinic), visit(clinic, code="ANOTHER", days_ago=9)
    publish(clinic, sid, {LEFT: "foot_l"})
    publish(clinic, retained, {RIGHT: "foot_r"})
    reviewed = clinic.app.state.reviewed
    with clinic.db.read() as c:
        pid = sessions.get(c, sid).patient_id
    if whole:
        erasure.erase_patient(clinic.db, reviewed, clinic.settings, None, pid, confirm=CODE)
    else:
        erasure.erase_session(clinic.db, reviewed, clinic.settings, None, sid)
    assert (count(clinic), places(clinic, LEFT, RIGHT)) == (1, {RIGHT: "foot_r"})


async def test_the_upload_page_and_the_tablet_offer_the_places_of_another_patients_take(
    clinic: Clinic,
) -> None:
    publish(clinic, visit(clinic, days_ago=2), {LEFT: "foot_l", RIGHT: "foot_r"})
    sid = visit(clinic, code="ANOTHER")
    fields: dict[str, Any] = {
        "devices": [device(LEFT), device(RIGHT)], "duration_s": 9.0, "protocol": "walk", "notices": [],
        "subject": {},
    }  # fmt: skip
    with clinic.db.write() as c:
        this = recordings.require_current(c, sid)
        recordings.publish_inspection(c, this.id, this.input_sha256, fields)
    async with clinic.client("clinician") as client:
        page = (await client.get(f"/sessions/{sid}/upload")).text
        code = (await client.post(f"/api/v1/sessions/{sid}/live")).json()["code"]
        paired = (await client.post("/api/v1/live/pairings", json={"code": code})).json()
    assert "As last time: 2 sensors" in page
    assert "Analyse confirms it" in page
    assert paired["remembered"] == {LEFT: "foot_l", RIGHT: "foot_r"}


def test_a_check_that_is_not_measured_is_told_with_its_reason() -> None:
    none = replace(DeviceCheck(LEFT, 100.0), reason="no_rest")
    days = [TODAY, TODAY]
    for checks, word in (([none], "Not measured"), ([check(LEFT), none], "First check")):
        verdict = judge_device(follow_device(checks), checks, days[: len(checks)])
        assert verdict.word == word
        assert "never still" in " ".join(verdict.reasons)
