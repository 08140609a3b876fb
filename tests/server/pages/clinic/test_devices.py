"""The pages of sensors: figures in the units of the page, charts, the limits that verdicts are made by."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY
from sagittal.core.quality.device_course import SCALE_MOVED, SCALE_OFF, DeviceCourse, follow_device
from sagittal.core.quality.devices import DeviceCheck
from sagittal.server.clinic.devices import DatedCheck, KnownDevice
from sagittal.server.pages.clinic.devices import _charts, _figures, _find_scale_band, _takes
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio

CHECK = DeviceCheck(
    "D1", 100.0, (1.0, 9.5), np.radians([0.1, -0.25, 0.0]), 0.002, np.array([0.0, 0.0, 1.0]), GRAVITY,
    radians(0.005), 120e-6 * GRAVITY,
)  # fmt: skip
NONE = DeviceCheck("D1", 100.0, reason="no_rest")


def known(*checks: DeviceCheck) -> KnownDevice:
    days = [dt.date(2026, 3, 1 + k) for k in range(len(checks))]
    dated = tuple(DatedCheck(day, "foot_l", check) for day, check in zip(days, checks, strict=True))
    return KnownDevice("D1", len(checks), dated, follow_device(checks))


def test_figures_are_in_the_units_of_the_page_with_a_dash_where_there_is_none() -> None:
    assert _figures(CHECK) == {
        "bias": "0.10 \u22120.25 0.00", "scale": "100.0", "gyro_noise": "0.005", "acc_noise": "120",
        "rest": "8.5",
    }  # fmt: skip
    quiet = replace(CHECK, gyro_noise=None, acc_noise=None)
    assert (_figures(quiet)["gyro_noise"], _figures(quiet)["acc_noise"]) == ("–", "–")
    assert set(_figures(NONE).values()) == set(_figures(None).values()) == {"–"}


def test_takes_stand_newest_first() -> None:
    rows = _takes(known(CHECK, NONE))
    assert [(r["day"].day, r["measured"], r["scale"]) for r in rows] == [(2, False, "–"), (1, True, "100.0")]
    assert rows[0]["rate"] == "100"


def test_charts_need_something_to_draw_and_the_distance_something_to_compare_with() -> None:
    titles = [c["title"] for c in _charts(known(CHECK, CHECK))]
    assert titles[0] == "Gyroscope bias, distance from usual"
    assert [t for t in titles if t.startswith("Gyroscope bias, ") and t[-2] == " "] == [
        f"Gyroscope bias, {axis}" for axis in "xyz"
    ]
    assert {"Gravity at rest", "Gyroscope noise", "Accelerometer noise"} <= set(titles)
    assert "Gyroscope bias, distance from usual" not in [c["title"] for c in _charts(known(CHECK))]
    assert _charts(known(NONE)) == []


@pytest.mark.parametrize("usual", [1.0, 1.0 + SCALE_OFF - SCALE_MOVED / 2, 0.98])
def test_gravity_is_told_outside_of_both_limits(usual: float) -> None:
    band = _find_scale_band(DeviceCourse(0, 1, usual_scale=usual))
    assert band is not None
    assert band[0] == pytest.approx(100 * max(usual * (1 - SCALE_MOVED), 1 - SCALE_OFF))
    assert band[1] == pytest.approx(100 * min(usual * (1 + SCALE_MOVED), 1 + SCALE_OFF))
    assert _find_scale_band(DeviceCourse(0, 0)) is None
    assert _find_scale_band(DeviceCourse(0, 1, usual_scale=2.0)) is None


async def test_a_sensor_that_nobody_knows_has_no_page(clinic: Clinic) -> None:
    async with clinic.client("clinician") as client:
        assert "No sensors yet" in (await client.get("/sensors")).text
        assert (await client.get("/sensors/D9")).status_code == 404
    async with clinic.client("viewer") as client:
        assert (await client.get("/sensors")).status_code == 403
