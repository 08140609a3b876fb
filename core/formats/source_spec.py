"""An entry of the manifest's `sources`: how to split a file into columns, and their meaning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import Final

from sagittal.core.errors import ManifestError
from sagittal.core.formats.json_tree import JsonNode
from sagittal.core.frames import GRAVITY

ACC_UNITS: Final[dict[str, float]] = {
    "m/s2": 1.0,
    "m/s^2": 1.0,
    "m/s²": 1.0,
    "g": GRAVITY,
    "mg": GRAVITY / 1e3,
}
GYR_UNITS: Final[dict[str, float]] = {
    "rad/s": 1.0,
    "deg/s": 0.017453292519943295,
    "°/s": 0.017453292519943295,
}
TIME_UNITS: Final[dict[str, float]] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
QUAT_ORDERS: Final = ("wxyz", "xyzw")
_SMALLEST_WRAP: Final = 16
"""A counter of fewer than 4 bits could not tell a lost stretch from none [our choice]."""


@dataclass(frozen=True)
class Channels:
    """Column names of one sensor in a table; several header rows are joined by "/".

    Parameters
    ----------
    acc, gyr, mag : three names each, x, y, z; a sensor's signals may be spread over several files.
    quat : four names in the order the source declares. linear, gravity : acceleration without gravity, and
        gravity, which are added up where there is no `acc`.
    """

    acc: tuple[str, ...] | None = None
    gyr: tuple[str, ...] | None = None
    mag: tuple[str, ...] | None = None
    quat: tuple[str, ...] | None = None
    linear: tuple[str, ...] | None = None
    gravity: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Counter:
    """A table column that counts samples, so that lost rows are recognised as lost time.

    Parameters
    ----------
    column : its name; increases by 1 per sample. wrap : it restarts from 0 at this count, None = 16 bit (32
        bit if it has larger values).
    """

    column: str
    wrap: int | None = None


@dataclass(frozen=True)
class SourceSpec:
    """How to read one file (or all files that match a pattern); None = determined by the file itself.

    Parameters
    ----------
    file : name or pattern with * and ?, compared with the whole path and with its last part.
    skip_rows : lines before the header. header_rows : lines of the header; None = as found in the file.
    index_column : the first column is no signal.
    rate_hz : nominal sampling rate. time_column, time_unit : column of time, and its unit or the length of
        one tick in s, None = detected; counter : sample counter; without either, time follows from the rate.
    gravity_included : False when the device has already removed gravity (refused with an error).
    columns : sensor id or segment → its columns; empty for formats that name their columns themselves.
    quat_order : "wxyz" or "xyzw". frame : "sensor" or None.
    """

    file: str
    skip_rows: int | None = None
    header_rows: int | None = None
    index_column: bool = False
    separator: str | None = None
    rate_hz: float | None = None
    time_column: str | None = None
    time_unit: str | float | None = None
    counter: Counter | None = None
    acc_unit: str | None = None
    gyr_unit: str | None = None
    mag_unit: str | None = None
    gravity_included: bool = True
    columns: Mapping[str, Channels] = field(default_factory=dict)
    quat_order: str | None = None
    frame: str | None = None

    def covers(self, name: str) -> bool:
        """Whether this entry applies to the file `name`."""
        last = name.replace("\\", "/").rsplit("/", 1)[-1]
        return self.file in (name, last) or fnmatchcase(name, self.file) or fnmatchcase(last, self.file)


_SOURCE_KEYS: Final = (
    "file", "skip_rows", "header_rows", "index_column", "separator", "rate_hz", "time_column", "time_unit",
    "counter", "acc_unit", "gyr_unit", "mag_unit", "gravity_included", "columns", "quat_order", "frame",
)  # fmt: skip


def read_source(node: JsonNode) -> SourceSpec:
    """Parse one entry of the manifest's `sources`.

    Raises
    ------
    ManifestError manifest_unknown_key, manifest_bad_value, unknown_unit, unsupported_frame; with the path.
    """
    node.only(*_SOURCE_KEYS)
    if node.text("file") is None:
        raise ManifestError(
            "manifest_bad_value", f"{node.path}.file is missing; give a file name or a pattern (*.txt)."
        )
    counter, rate = _counter(node)
    frame = node.choice("frame", ("sensor",), "unsupported_frame")
    columns = node.child("columns")
    gravity = node.flag("gravity_included")
    return SourceSpec(
        file=node.string("file"),
        skip_rows=node.count("skip_rows", 0, 1000) if node.has("skip_rows") else None,
        header_rows=node.count("header_rows", 1, 10) if node.has("header_rows") else None,
        index_column=node.flag("index_column") or False,
        separator=node.choice("separator", (",", ";", "\t", " ", "|"), "manifest_bad_value"),
        rate_hz=rate,
        time_column=node.text("time_column"),
        time_unit=_time_unit(node),
        counter=counter,
        acc_unit=node.choice("acc_unit", tuple(ACC_UNITS), "unknown_unit"),
        gyr_unit=node.choice("gyr_unit", tuple(GYR_UNITS), "unknown_unit"),
        mag_unit=node.text("mag_unit"),
        gravity_included=True if gravity is None else gravity,
        columns=MappingProxyType({k: _channels(columns.child(k)) for k in columns.keys}),
        quat_order=node.choice("quat_order", QUAT_ORDERS, "manifest_bad_value"),
        frame=frame,
    )


def _counter(node: JsonNode) -> tuple[Counter | None, float | None]:
    """Sample counter of a table, if any, and samples per second."""
    rate = _rate(node)
    inner = node.child("counter")
    if not inner.keys:
        return None, rate
    inner.only("column", "rate_hz", "wrap")
    count_rate = _rate(inner)
    if rate is not None and count_rate is not None and rate != count_rate:
        raise ManifestError(
            "manifest_bad_value",
            f"{node.path} has rate_hz {rate:g} and counter.rate_hz {count_rate:g}; give one of them.",
        )
    if node.text("time_column") is not None:
        raise ManifestError(
            "manifest_bad_value", f"{node.path} has time_column and counter; give one of them as the clock."
        )
    wrap = inner.count("wrap", 0, 1 << 53) or None
    if wrap is not None and wrap < _SMALLEST_WRAP:
        raise ManifestError(
            "manifest_bad_value",
            f"{inner.path}.wrap is {wrap}; expected how many counts there are, 256 for one of 8 bits.",
        )
    return Counter(inner.string("column"), wrap), rate if count_rate is None else count_rate


def _time_unit(node: JsonNode) -> str | float | None:
    """Name of the unit of time, or the length of one tick in s."""
    if not node.is_number("time_unit"):
        return node.choice("time_unit", tuple(TIME_UNITS), "unknown_unit")
    tick = node.number("time_unit")
    if tick is None or not 1e-9 <= tick <= 86_400.0:
        raise ManifestError(
            "manifest_bad_value",
            f"{node.at('time_unit')} is {tick:g}; expected the length of one tick in s, 0.0001 for 0.1 ms.",
        )
    return tick


def _rate(node: JsonNode) -> float | None:
    rate = node.number("rate_hz")
    if rate is not None and not 1.0 <= rate <= 10_000.0:
        raise ManifestError(
            "manifest_bad_value", f"{node.at('rate_hz')} is {rate:g}; expected 1 to 10000 samples/s."
        )
    return rate


def _channels(node: JsonNode) -> Channels:
    node.only("acc", "gyr", "mag", "quat", "linear", "gravity")
    acc = node.names("acc", 3)
    gyr, mag, quat = node.names("gyr", 3), node.names("mag", 3), node.names("quat", 4)
    linear, gravity = node.names("linear", 3), node.names("gravity", 3)
    if not any((acc, gyr, mag, linear, gravity)):
        raise ManifestError(
            "manifest_bad_value", f"{node.path}.acc is missing; name three columns (x, y, z)."
        )
    return Channels(acc, gyr, mag, quat, linear, gravity)
