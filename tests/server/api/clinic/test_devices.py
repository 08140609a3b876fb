"""The clinic's sensors as programs read them."""

from __future__ import annotations

import csv
import datetime as dt
import io

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY
from sagittal.core.quality.devices import DeviceCheck
from sagittal.server.api.clinic.devices import COLUMNS
from sagittal.server.clinic import devices, patients, sessions
from sagittal.server.uploads import receiving, recordings
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio

MEASURED = DeviceCheck(
    "D1",
    100.0,
    (1.0, 9.0),
    np.array([0.1, 0.2, 0.3]),
    0.002,
    np.array([0.0, 0.6, 0.8]),
    9.7,
    2e-4,
    1e-3,
)


def publish(clinic: Clinic, day: dt.date, checks: dict[str, DeviceCheck]) -> None:
    with clinic.db.write() as c:
        known_by_code = {p.code: p.id for p in patients.list_patients(c, None)}
        pid = known_by_code.get("P-1") or patients.create(c, None, code="P-1").id
        sid = sessions.create(c, None, pid, performed_on=day).id
    state = clinic.app.state
    with receiving.receive(clinic.db, state.blobs, clinic.settings, None, sid, "walk.txt") as upload:
        upload.write(b"x")
        upload.keep()
    result = [{**x.to_json(), "segment": segment, "exchanged": False} for segment, x in checks.items()]
    with clinic.db.write() as c:
        devices.keep_checks(c, recordings.require_current(c, sid).id, result)


async def test_a_check_is_told_in_si_units_and_what_is_not_measured_is_null_with_its_reason(
    clinic: Clinic,
) -> None:
    first, last = dt.date(2026, 3, 1), dt.date(2026, 3, 8)
    publish(clinic, first, {"foot_l": MEASURED})
    publish(clinic, last, {"shank_r": DeviceCheck("D1", 50.0, reason="no_rest")})
    async with clinic.client("assistant") as client:
        body = (await client.get("/api/v1/devices/D1")).json()
        listed = (await client.get("/api/v1/devices")).json()
        table = await client.get("/api/v1/devices.csv")
        assert (await client.get("/api/v1/devices/D2")).status_code == 404
    assert listed == [body]
    assert (body["last_worn_on"], body["last_segment"], body["takes"]) == ("2026-03-08", "shank_r", 2)
    assert (body["state"], body["words"]) == ("unknown", "First check")
    assert body["checks"] == [
        {
            "day": "2026-03-01", "segment": "foot_l", "rate_hz": 100.0, "rest_s": [1.0, 9.0],
            "gyro_bias_rad_s": [0.1, 0.2, 0.3], "bias_error_rad_s": 0.002, "up": [0.0, 0.6, 0.8],
            "rest_norm_mps2": 9.7, "gravity_scale": 9.7 / GRAVITY, "gyro_noise_rad_s_rthz": 2e-4,
            "acc_noise_mps2_rthz": 1e-3, "reason": None,
        },
        dict.fromkeys(body["checks"][0])
        | {"day": "2026-03-08", "segment": "shank_r", "rate_hz": 50.0, "reason": "no_rest"},
    ]  # fmt: skip
    assert 'filename="sensors.csv"' in table.headers["content-disposition"]
    rows = list(csv.DictReader(io.StringIO(table.text.lstrip("\ufeff"))))
    assert tuple(rows[0]) == COLUMNS
    one, second = rows
    assert [float(one[c]) for c in ("rest_start_s", "rest_end_s", "gyro_bias_z_rad_s", "up_y")] == [
        1.0,
        9.0,
        0.3,
        0.6,
    ]
    assert (one["day"], one["reason"]) == ("2026-03-01", "")
    assert {c: v for c, v in second.items() if v} == {
        "device_id": "D1", "day": "2026-03-08", "segment": "shank_r", "rate_hz": second["rate_hz"],
        "reason": "no_rest",
    }  # fmt: skip
    assert float(second["rate_hz"]) == 50.0
