"""The clinic's sensors by serial number, without patient data; undefined values are null."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal

from fastapi import APIRouter
from starlette.responses import Response

from sagittal.server.api.downloads.downloads import BINARY, attachment
from sagittal.server.auth.access import require
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Action
from sagittal.server.clinic import devices
from sagittal.server.clinic.devices import DatedCheck, KnownDevice
from sagittal.server.context import Db, DeviceId
from sagittal.server.report.files.columns import write_csv
from sagittal.server.report.words.device_words import judge_device

router = APIRouter(tags=["devices"])
Reader = Annotated[Identity, require(Action.READ_DEVICE)]

STATES: Final[dict[str, Literal["steady", "changed", "unknown"]]] = {
    "ok": "steady",
    "warn": "changed",
    "none": "unknown",
}
"""Style of an assessment → value for programs."""

COLUMNS = (
    "device_id", "day", "segment", "rate_hz", "rest_start_s", "rest_end_s",
    "gyro_bias_x_rad_s", "gyro_bias_y_rad_s", "gyro_bias_z_rad_s", "bias_error_rad_s", "up_x", "up_y", "up_z",
    "rest_norm_mps2", "gravity_scale", "gyro_noise_rad_s_rthz", "acc_noise_mps2_rthz", "reason",
)  # fmt: skip


@dataclass(frozen=True)
class DeviceCheckAnswer:
    """Check of a sensor in one trial, in sensor axes, or the reason why there is none.

    `rest_s`: still period, from the sensor's first sample. `bias_error`: uncertainty due to slow rotation of
    the wearer. `up`: the vertical. `rthz`: per √Hz.
    """

    day: dt.date
    segment: str
    rate_hz: float
    rest_s: tuple[float, float] | None
    gyro_bias_rad_s: list[float] | None
    bias_error_rad_s: float | None
    up: list[float] | None
    rest_norm_mps2: float | None
    gravity_scale: float | None
    gyro_noise_rad_s_rthz: float | None
    acc_noise_mps2_rthz: float | None
    reason: str | None


@dataclass(frozen=True)
class DeviceAnswer:
    """A sensor: last placement, assessment with reasons, and latest checks, oldest first."""

    device_id: str
    last_worn_on: dt.date
    last_segment: str
    takes: int
    state: Literal["steady", "changed", "unknown"]
    words: str
    reasons: list[str]
    checks: list[DeviceCheckAnswer]


@router.get("/devices", response_model=list[DeviceAnswer])
def list_devices(db: Db, user: Reader) -> list[DeviceAnswer]:
    """List sensors of the clinic with their latest checks, most recently used first."""
    with db.read() as c:
        return [_answer(d) for d in devices.list_devices(c)]


@router.get(
    "/devices.csv",
    response_class=Response,
    responses={200: {"description": "The table", "content": {"text/csv": {"schema": BINARY}}}},
)
def read_checks_table(db: Db, user: Reader) -> Response:
    """Device checks as a table: one row per sensor and trial."""
    with db.read() as c:
        sensors = devices.list_devices(c)
    return attachment(write_csv(COLUMNS, _rows(sensors)), "sensors.csv")


@router.get("/devices/{device_id}", response_model=DeviceAnswer)
def read_device(device_id: DeviceId, db: Db, user: Reader) -> DeviceAnswer:
    """One sensor."""
    with db.read() as c:
        return _answer(devices.get(c, device_id))


def _answer(d: KnownDevice) -> DeviceAnswer:
    verdict = judge_device(d.course, [x.check for x in d.checks], [x.day for x in d.checks])
    return DeviceAnswer(
        device_id=d.device_id,
        last_worn_on=d.last.day,
        last_segment=d.last.segment,
        takes=d.takes,
        state=STATES[verdict.kind],
        words=verdict.word,
        reasons=list(verdict.reasons),
        checks=[_check(x) for x in d.checks],
    )


def _check(x: DatedCheck) -> DeviceCheckAnswer:
    k = x.check
    return DeviceCheckAnswer(
        day=x.day,
        segment=x.segment,
        rate_hz=k.rate_hz,
        rest_s=k.rest_s,
        gyro_bias_rad_s=None if k.gyro_bias is None else k.gyro_bias.tolist(),
        bias_error_rad_s=k.bias_error,
        up=None if k.up is None else k.up.tolist(),
        rest_norm_mps2=k.rest_norm,
        gravity_scale=k.gravity_scale,
        gyro_noise_rad_s_rthz=k.gyro_noise,
        acc_noise_mps2_rthz=k.acc_noise,
        reason=k.reason,
    )


def _rows(sensors: Sequence[KnownDevice]) -> Iterator[Sequence[object]]:
    for d in sensors:
        for k in map(_check, d.checks):
            yield (
                d.device_id, k.day.isoformat(), k.segment, k.rate_hz, *(k.rest_s or (None, None)),
                *(k.gyro_bias_rad_s or (None, None, None)), k.bias_error_rad_s, *(k.up or (None, None, None)),
                k.rest_norm_mps2, k.gravity_scale, k.gyro_noise_rad_s_rthz, k.acc_noise_mps2_rthz, k.reason,
            )  # fmt: skip
