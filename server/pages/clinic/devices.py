"""Sensors of the clinic: condition and checks, without reference to patients or visits."""

from __future__ import annotations

from math import degrees
from typing import Annotated, Any, Final
from urllib.parse import quote

import numpy as np
from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response

from sagittal.core.frames import GRAVITY
from sagittal.core.message import Message
from sagittal.core.quality.device_course import (
    ACC_NOISE_ROSE,
    BIAS_MOVED,
    GYRO_NOISE_ROSE,
    SCALE_MOVED,
    SCALE_OFF,
    DeviceCourse,
)
from sagittal.core.quality.devices import DeviceCheck
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import devices
from sagittal.server.clinic.devices import KnownDevice
from sagittal.server.context import Db, DeviceId
from sagittal.server.pages.shell import render_page
from sagittal.server.pages.words import SEGMENT_NAMES
from sagittal.server.report.history.device_chart import draw_device
from sagittal.server.report.words.device_words import judge_device
from sagittal.server.report.words.wording import format_number

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)

LIMITS: Final = {
    "bias": f"{degrees(BIAS_MOVED):g}",
    "scale": f"{100 * SCALE_MOVED:g}",
    "off": f"{100 * SCALE_OFF:g}",
    "gyro_noise": f"{GYRO_NOISE_ROSE:g}",
    "acc_noise": f"{ACC_NOISE_ROSE:g}",
}
"""Limits as shown on pages: °/s, %, %, times, times."""


@router.get("/sensors")
def show_devices(
    request: Request, db: Db, user: Annotated[Identity, require(Action.READ_DEVICE)]
) -> Response:
    """All sensors of the clinic with last placement and assessment."""
    with db.read() as c:
        rows = [_row(d) for d in devices.list_devices(c)]
    rows.sort(key=lambda row: row["verdict"].kind != "warn")
    return render_page(request, db, user, "devices.html", "devices", devices=rows, limits=LIMITS)


@router.get("/sensors/{device_id}")
def show_device(
    request: Request, db: Db, device_id: DeviceId, user: Annotated[Identity, require(Action.READ_DEVICE)]
) -> Response:
    """History of one sensor."""
    with db.read() as c:
        device = devices.get(c, device_id)
    view: dict[str, Any] = {
        "d": _row(device),
        "charts": _charts(device),
        "takes": _takes(device),
        "limits": LIMITS,
    }
    return render_page(request, db, user, "device.html", "devices", **view)


def _row(d: KnownDevice) -> dict[str, Any]:
    newest = None if d.course.newest is None else d.checks[d.course.newest].check
    return {
        "id": d.device_id,
        "href": f"/sensors/{quote(d.device_id, safe='')}",
        "day": d.last.day,
        "segment": SEGMENT_NAMES[d.last.segment],
        "takes": d.takes,
        "verdict": judge_device(d.course, [x.check for x in d.checks], [x.day for x in d.checks]),
        **_figures(newest),
    }


def _figures(check: DeviceCheck | None) -> dict[str, str]:
    """Values of a check as text, a dash if missing."""
    if check is None or check.gyro_bias is None or check.gravity_scale is None:
        return dict.fromkeys(("bias", "scale", "gyro_noise", "acc_noise", "rest"), "–")
    start, end = check.rest_s or (0.0, 0.0)
    return {
        "bias": " ".join(format_number(degrees(b), 2) for b in check.gyro_bias),
        "scale": format_number(100 * check.gravity_scale, 1),
        "gyro_noise": "–" if check.gyro_noise is None else format_number(degrees(check.gyro_noise), 3),
        "acc_noise": "–" if check.acc_noise is None else format_number(1e6 * check.acc_noise / GRAVITY),
        "rest": format_number(end - start, 1),
    }


def _takes(d: KnownDevice) -> list[dict[str, Any]]:
    """Trials of a sensor as table rows, newest first."""
    return [
        {
            "day": x.day,
            "segment": SEGMENT_NAMES[x.segment],
            "rate": f"{x.check.rate_hz:g}",
            "measured": x.check.reason is None,
            **_figures(x.check),
        }
        for x in reversed(d.checks)
    ]


def _charts(d: KnownDevice) -> list[dict[str, str]]:
    """Charts of bias and gravity with tolerance bands, and of both noise levels."""
    checks, days, course = [x.check for x in d.checks], [x.day for x in d.checks], d.course
    charts: list[dict[str, str]] = []

    def add(
        title: str,
        unit: str,
        values: list[float | None],
        digits: int,
        least: float,
        band: tuple[float, float] | None = None,
    ) -> None:
        svg = draw_device(title, days, values, digits=digits, least=least, band=band)
        if svg is not None:
            charts.append({"title": title, "unit": unit, "svg": svg})

    biases = [None if k.gyro_bias is None else np.degrees(k.gyro_bias) for k in checks]
    if course.usual_bias is not None:
        usual = np.degrees(course.usual_bias)
        moved = [None if b is None else float(np.linalg.norm(b - usual)) for b in biases]
        add("Gyroscope bias, distance from usual", "°/s", moved, 2, 0.0, (0.0, degrees(course.bias_limit)))
    for i, axis in enumerate("xyz"):
        values = [None if b is None else float(b[i]) for b in biases]
        add(Message("Gyroscope bias, {axis}", axis=axis), "°/s", values, 2, 2.0 * degrees(BIAS_MOVED))
    scale = [_times(100.0, k.gravity_scale) for k in checks]
    add("Gravity at rest", "% of 9.81 m/s²", scale, 1, 200.0 * SCALE_MOVED, _find_scale_band(course))
    add("Gyroscope noise", "°/s/√Hz", [_times(degrees(1.0), k.gyro_noise) for k in checks], 3, 0.01)
    add("Accelerometer noise", "µg/√Hz", [_times(1e6 / GRAVITY, k.acc_noise) for k in checks], 0, 100.0)
    return charts


def _find_scale_band(course: DeviceCourse) -> tuple[float, float] | None:
    """Range of gravity in percent without a notice; None if there is nothing to compare with."""
    if course.usual_scale is None:
        return None
    usual = 100.0 * course.usual_scale
    low = max(usual * (1.0 - SCALE_MOVED), 100.0 * (1.0 - SCALE_OFF))
    high = min(usual * (1.0 + SCALE_MOVED), 100.0 * (1.0 + SCALE_OFF))
    return (low, high) if low < high else None


def _times(factor: float, value: float | None) -> float | None:
    return None if value is None else factor * value
