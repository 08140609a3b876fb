"""Sensor, quantity, axis and unit from the name of a column or file, and recognition of time columns."""

from __future__ import annotations

import re
from typing import Final

from sagittal.core.formats.source import stem_of

_AXIS: Final = re.compile(r"^(?P<rest>.*?)[\s_./\-:]*(?P<axis>[xyzwXYZW]|[0-3])$")
_CHANNEL: Final = re.compile(r"(?<=[.:_][xyzwXYZW]) \d{1,2}$")
"""Number of a channel behind its axis ("ACC.X 1")."""
_UNIT: Final = re.compile(r"[\[(](?P<unit>[^\])]{1,12})[\])]\s*$")
_KINDS: Final = (
    ("free", re.compile(r"free[\s_]*acc|lin(?:ear)?[\s_]*acc|user[\s_]*acc", re.IGNORECASE)),
    ("acc", re.compile(r"acc(?:el(?:erometer|eration)?)?(?![a-z])", re.IGNORECASE)),
    (
        "gyr",
        re.compile(
            r"gyr(?:o(?:scope)?)?(?![a-z])|angular[\s_]*(?:velocity|rate)|rate[\s_]*of[\s_]*turn",
            re.IGNORECASE,
        ),
    ),
    ("mag", re.compile(r"mag(?:n(?:et(?:ometer|ic[\s_]*field)?)?)?(?![a-z])", re.IGNORECASE)),
    ("quat", re.compile(r"quat(?:ernion)?(?![a-z])|(?:^|[\s_./\-])q$", re.IGNORECASE)),
)
_SHORT: Final = re.compile(
    r"^(?P<sensor>.*?[\s_./\-])??(?P<kind>a|g|w|m|gf|gyro|acc)[\s_]?(?P<axis>[xyz])$", re.IGNORECASE
)
"""Names such as "ax", "foot gz", "wy"."""
_SHORT_KINDS: Final = {
    "a": "acc",
    "acc": "acc",
    "gf": "acc",
    "g": "gyr",
    "w": "gyr",
    "gyro": "gyr",
    "m": "mag",
}
_AXIS_FIRST: Final = re.compile(r"^(?P<axis>[xyz])(?:[\s_\-]*axis)?$", re.IGNORECASE)
"""Names such as "x-axis", "Y", whose unit or file says what they are."""
_TRAILING: Final = re.compile(r"[\s_](?P<unit>m/s/s|m/s\^?2|m/s²|deg/s|dps|rad/s|mg|g)$", re.IGNORECASE)
_UNIT_KINDS: Final = {
    "m/s2": "acc", "g": "acc", "mg": "acc", "deg/s": "gyr", "rad/s": "gyr", "ut": "mag", "µt": "mag",
}  # fmt: skip
_TIME: Final = re.compile(
    r"(?:^|[\s_.(\[\-/])(?:time|timestamps?|datetime|date|tod|epoch?|unix|local|utc|elapsed|seconds|clock|t)"
    r"(?=$|[\s_.)\[(\-:/])",
    re.IGNORECASE,
)
_FILE_KINDS: Final = (
    ("gravity", re.compile(r"gravity", re.IGNORECASE)),
    ("linear", re.compile(r"lin(?:ear)?[\s_\-]*acc\w*|user[\s_\-]*acc\w*", re.IGNORECASE)),
    (
        "acc",
        re.compile(
            r"(?:total[\s_\-]*)?acc(?:el(?:erometer|eration)?)?(?:[\s_\-]*uncalibrated)?(?![a-z])",
            re.IGNORECASE,
        ),
    ),
    ("gyr", re.compile(r"gyr(?:o(?:scope)?)?(?:[\s_\-]*uncalibrated)?(?![a-z])", re.IGNORECASE)),
    ("mag", re.compile(r"magn?(?:et(?:ometer)?)?(?:[\s_\-]*uncalibrated)?(?![a-z])", re.IGNORECASE)),
)
_ADDRESS: Final = re.compile(r"(?:^|[_\-])([0-9A-F]{12})(?:[_\-]|$)", re.IGNORECASE)
_SAID: Final = {
    "m/s/s": "m/s2",
    "m/s^2": "m/s2",
    "m/s2": "m/s2",
    "m/s²": "m/s2",
    "g": "g",
    "mg": "mg",
    "deg/s": "deg/s",
    "dps": "deg/s",
    "°/s": "deg/s",
    "rad/s": "rad/s",
}


def is_time_name(name: str) -> bool:
    """Whether a column is called like a time."""
    return _TIME.search(name) is not None


def read_name(name: str, file_kind: str | None = None) -> tuple[str, str, str, str] | None:
    """Sensor, quantity, axis and unit given in the name of a column.

    Parameters
    ----------
    file_kind : quantity of a file whose columns are called x, y and z alone.
    """
    unit = ""
    plain = name.strip()
    if name_match := _UNIT.search(plain) or _TRAILING.search(plain):
        unit, plain = name_match["unit"].strip().lower(), plain[: name_match.start()].strip()
        unit = _SAID.get(unit, unit)
    plain = _CHANNEL.sub("", plain)
    if axis_match := _AXIS_FIRST.match(plain):
        kind = _UNIT_KINDS.get(unit) or file_kind
        kind = file_kind if file_kind in ("linear", "gravity") and kind == "acc" else kind
        return None if kind is None else ("", kind, axis_match["axis"].lower(), _known(unit))
    if (axis := _AXIS.match(plain)) is None:
        return None
    remainder = axis["rest"]
    for kind, pattern in _KINDS:
        if name_match := pattern.search(remainder):
            if kind == "free":
                return None
            sensor = re.sub(
                r"[\s_./\-:]+$|^[\s_./\-:]+",
                "",
                remainder[: name_match.start()] + " " + remainder[name_match.end() :],
            )
            return re.sub(r"\s+", " ", sensor).strip(), kind, axis["axis"].lower(), _known(unit)
    if short := _SHORT.match(plain):
        sensor = re.sub(r"[\s_./\-:]+$", "", short["sensor"] or "")
        kind = _SHORT_KINDS[short["kind"].lower()]
        return (
            sensor,
            kind,
            short["axis"].lower(),
            _known(unit) or ("g" if short["kind"].lower() == "gf" else ""),
        )
    return None


def names_quantity(name: str) -> bool:
    """Whether the name of a column spells out its quantity, which goes before a short name such as "ax"."""
    return any(pattern.search(name) for _, pattern in _KINDS)


def _known(unit: str) -> str:
    return unit if unit in _SAID.values() else ""


def read_file_kind(name: str) -> tuple[str | None, str]:
    """Quantity given in a file name, and the name of the sensor: the rest of the file name.

    "MetaWear_2023_C2B2CE9BB701_Gyroscope_100Hz.csv" is of sensor C2B2CE9BB701, "left_foot_Gyroscope.csv" of
    left_foot, "Accelerometer.csv" of its folder, else "sensor".
    """
    stem = stem_of(name)
    for kind, pattern in _FILE_KINDS:
        if match := pattern.search(stem):
            if address := _ADDRESS.search(stem):
                return kind, address[1]
            prefix = stem[: match.start()].strip("_-. ")
            folder = name.replace("\\", "/").rsplit("/", 2)[-2] if "/" in name.replace("\\", "/") else ""
            return kind, prefix or stem[match.end() :].strip("_-. ") or folder or "sensor"
    return None, stem
