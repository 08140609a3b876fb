"""Wording of sensor checks: assessment, reasons and remedies (docs/science/devices.md, "Limits")."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from typing import Final

from sagittal.core.message import Message
from sagittal.core.quality.device_course import DeviceCourse, DeviceFinding
from sagittal.core.quality.devices import DeviceCheck
from sagittal.server.report.words.wording import format_number
from sagittal.web.words import day

NOT_MEASURED: Final = {
    "no_rest": "It was never still for one second. Ask the person to stand still at the start.",
    "no_gyroscope": "It sent no angular rate.",
    "unit_suspect": "Its reading at rest is not gravity. Check the unit of the export.",
}
"""Reason of a check → a sentence."""

ADVICE: Final = {
    "gyro_bias": "Let it warm up for ten minutes and record again; if it stays, recalibrate it.",
    "scale": "Let it warm up for ten minutes and record again; if it stays, recalibrate its accelerometer.",
    "scale_off": "Recalibrate its accelerometer.",
    "gyro_noise": "Check strap and case. Tremor of the wearer has the same effect.",
    "acc_noise": "Check strap and case. Tremor of the wearer has the same effect.",
}
"""Quantity of a finding → remedy."""


@dataclass(frozen=True)
class DeviceVerdict:
    """Assessment of a sensor in words.

    Parameters
    ----------
    kind : style of the state, "ok", "warn" or "none". reasons : sentences, each with a remedy.
    """

    kind: str
    word: str
    reasons: tuple[str, ...]


def judge_device(
    course: DeviceCourse, checks: Sequence[DeviceCheck], days: Sequence[dt.date]
) -> DeviceVerdict:
    """Describe the history of a sensor; `checks` and their `days` are those it was computed from."""
    if course.newest is None:
        return DeviceVerdict("none", "Not measured", (NOT_MEASURED[checks[-1].reason or "no_rest"],))
    late: tuple[str, ...] = ()
    if checks[-1].reason is not None:
        cause = NOT_MEASURED[checks[-1].reason]
        late = (
            Message(
                "Last measured on {day}, not in its latest trial. {cause}",
                day=day(days[course.newest]),
                cause=cause,
            ),
        )
    if course.findings:
        texts = [_tell(f, days) for f in course.findings]
        prefixes = ["" if text == texts[0] else f"{text}. " for text in texts]
        reasons = [f"{text}{ADVICE[f.quantity]}" for text, f in zip(prefixes, course.findings, strict=True)]
        return DeviceVerdict("warn", texts[0], (*reasons, *late))
    if course.compared == 0:
        return DeviceVerdict("none", "First check", ("Nothing to compare with yet.", *late))
    return DeviceVerdict("ok", "Steady", late)


def _tell(f: DeviceFinding, days: Sequence[dt.date]) -> str:
    since = "" if f.since is None else Message(" since {day}", day=day(days[f.since]))
    if f.quantity == "gyro_bias":
        return Message(
            "Bias moved by {format_number} °/s{since}",
            format_number=format_number(degrees(f.value), 1),
            since=since,
        )
    if f.quantity == "scale":
        percent = format_number(100 * abs(f.value), 1)
        if f.since is None:
            return (
                Message("Gravity reads {percent} % more", percent=percent)
                if f.value > 0
                else Message("Gravity reads {percent} % less", percent=percent)
            )
        moved = day(days[f.since])
        if f.value > 0:
            return Message("Gravity reads {percent} % more since {moved}", percent=percent, moved=moved)
        return Message("Gravity reads {percent} % less since {moved}", percent=percent, moved=moved)
    if f.quantity == "scale_off":
        way = "much" if f.value > 0 else "little"
        return Message(
            "Gravity reads {format_number} % too {way}",
            format_number=format_number(100 * abs(f.value), 1),
            way=way,
        )
    sensor_kind = "Gyroscope" if f.quantity == "gyro_noise" else "Accelerometer"
    return Message(
        "{sensor_kind} noise {value} times its usual{since}",
        sensor_kind=sensor_kind,
        value=format_number(f.value, 1),
        since=since,
    )
