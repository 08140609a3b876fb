"""The manifest: what the files cannot say themselves (docs/formats.md).

Parsed by hand instead of by a schema library: core knows only numpy and scipy, and a message must name the
exact place ("sources[0].columns.foot_l.acc") and what would be right there.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import Final

from core.errors import ManifestError
from core.formats.aliases import segment_named
from core.frames import GRAVITY, PROTOCOLS, SEGMENTS, Protocol, Segment
from core.recording import Subject

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
MAX_BYTES: Final = 1_000_000
"""A manifest is a page of text; more is a mistake."""


@dataclass(frozen=True)
class Channels:
    """Column names of one sensor in a table; several header rows are joined by "/".

    Parameters
    ----------
    acc, gyr, mag : three names each, x, y, z. quat : four names in the order the source declares.
    """

    acc: tuple[str, ...]
    gyr: tuple[str, ...] | None = None
    mag: tuple[str, ...] | None = None
    quat: tuple[str, ...] | None = None


@dataclass(frozen=True)
class SourceSpec:
    """How one file (or all files that match a pattern) is to be read; None = the file says so itself.

    Parameters
    ----------
    file : name or pattern with * and ?, compared with the whole path and with its last part.
    skip_rows : lines before the header. header_rows : lines of the header.
    index_column : the first column is no signal.
    rate_hz : nominal sampling rate. time_column, time_unit : where the time is; else the rate makes it.
    gravity_included : False when the device has already removed gravity (not usable, said so).
    columns : sensor id or segment → its columns; empty for formats that name their columns themselves.
    quat_order : "wxyz" or "xyzw". frame : "sensor" or None.
    """

    file: str
    skip_rows: int = 0
    header_rows: int = 1
    index_column: bool = False
    separator: str | None = None
    rate_hz: float | None = None
    time_column: str | None = None
    time_unit: str = "s"
    acc_unit: str | None = None
    gyr_unit: str | None = None
    mag_unit: str | None = None
    gravity_included: bool = True
    columns: Mapping[str, Channels] = field(default_factory=dict)
    quat_order: str | None = None
    frame: str | None = None

    def covers(self, name: str) -> bool:
        """Tell whether this entry speaks of the file `name`."""
        last = name.replace("\\", "/").rsplit("/", 1)[-1]
        return self.file in (name, last) or fnmatchcase(name, self.file) or fnmatchcase(last, self.file)


@dataclass(frozen=True)
class Manifest:
    """What somebody declared about a take.

    Parameters
    ----------
    sensors : device id → segment, None = ignore this sensor.
    protocol : None = not said (walk).
    """

    subject: Subject = field(default_factory=Subject)
    protocol: Protocol | None = None
    mounting: Mapping[str, str] = field(default_factory=dict)
    sensors: Mapping[str, Segment | None] = field(default_factory=dict)
    sources: tuple[SourceSpec, ...] = ()

    def source_of(self, name: str) -> SourceSpec | None:
        """First entry of `sources` that covers a file."""
        return next((s for s in self.sources if s.covers(name)), None)


def is_manifest(value: object) -> bool:
    """Tell whether a JSON value means to be a manifest."""
    return isinstance(value, dict) and bool(
        value.keys() & {"sensors", "sources", "subject", "protocol", "mounting"}
    )


def parse_manifest(data: bytes) -> Manifest:
    """Read a manifest from JSON text.

    Raises
    ------
    ManifestError
        manifest_bad_json, manifest_unknown_key, manifest_bad_value, unknown_segment, duplicate_segment,
        unknown_protocol, height_implausible, unknown_unit; the message names the path inside the manifest.
    """
    if len(data) > MAX_BYTES:
        raise ManifestError(
            "manifest_bad_json", f"The manifest has {len(data)} bytes, at most {MAX_BYTES} make sense."
        )
    try:
        root = json.loads(data.decode("utf-8-sig"), parse_constant=_no_constant, object_pairs_hook=_unique)
    except (ValueError, RecursionError) as e:
        raise ManifestError("manifest_bad_json", f"The manifest is not valid JSON: {e}.") from e
    return manifest_of(root)


def manifest_of(root: object) -> Manifest:
    """Build a manifest from decoded JSON; errors as in `parse_manifest`."""
    top = _Node(root, "")
    top.only("subject", "protocol", "mounting", "sensors", "sources")
    subject = top.child("subject")
    subject.only("height_m")
    height = subject.number("height_m")
    if height is not None and not 0.5 <= height <= 2.5:
        raise ManifestError(
            "height_implausible",
            f"subject.height_m is {height:g}; expected 0.5 to 2.5, in metres (1.75, not 175).",
        )
    protocol = top.text("protocol")
    if protocol is not None and protocol not in PROTOCOLS:
        raise ManifestError(
            "unknown_protocol", f"protocol is '{protocol}'; expected one of {', '.join(PROTOCOLS)}."
        )
    mounting = top.child("mounting")
    sensors = top.child("sensors")
    return Manifest(
        subject=Subject(height),
        protocol=protocol,
        mounting=MappingProxyType({_segment(k, f"mounting.{k}"): mounting.string(k) for k in mounting.keys}),
        sensors=MappingProxyType(_sensors(sensors)),
        sources=tuple(_source(n) for n in top.children("sources")),
    )


def _sensors(node: _Node) -> dict[str, Segment | None]:
    out: dict[str, Segment | None] = {}
    worn: dict[str, str] = {}
    for device in node.keys:
        name = node.text(device)
        if name is None:
            out[device] = None
            continue
        segment = _segment(name, f"sensors.{device}")
        if segment in worn:
            raise ManifestError(
                "duplicate_segment",
                f"sensors.{device}: {segment} is already given to {worn[segment]}; "
                "choose one, the other is null or another segment.",
                sensor=device,
            )
        worn[segment] = device
        out[device] = segment
    return out


def _segment(name: str, path: str) -> Segment:
    segment = segment_named(name)
    if segment is None:
        raise ManifestError(
            "unknown_segment",
            f"{path}: '{name}' is no segment; expected one of {', '.join(SEGMENTS)} or null.",
        )
    return segment


_SOURCE_KEYS: Final = (
    "file", "skip_rows", "header_rows", "index_column", "separator", "rate_hz", "time_column", "time_unit",
    "acc_unit", "gyr_unit", "mag_unit", "gravity_included", "columns", "quat_order", "frame",
)  # fmt: skip


def _source(node: _Node) -> SourceSpec:
    node.only(*_SOURCE_KEYS)
    if node.text("file") is None:
        raise ManifestError(
            "manifest_bad_value", f"{node.path}.file is missing; give a file name or a pattern (*.txt)."
        )
    rate = node.number("rate_hz")
    if rate is not None and not 1.0 <= rate <= 10_000.0:
        raise ManifestError(
            "manifest_bad_value", f"{node.path}.rate_hz is {rate:g}; expected 1 to 10000 samples/s."
        )
    frame = node.choice("frame", ("sensor",), "unsupported_frame")
    columns = node.child("columns")
    gravity = node.flag("gravity_included")
    return SourceSpec(
        file=node.string("file"),
        skip_rows=node.count("skip_rows", 0, 1000),
        header_rows=node.count("header_rows", 1, 10),
        index_column=node.flag("index_column") or False,
        separator=node.choice("separator", (",", ";", "\t", " ", "|"), "manifest_bad_value"),
        rate_hz=rate,
        time_column=node.text("time_column"),
        time_unit=node.choice("time_unit", tuple(TIME_UNITS), "unknown_unit") or "s",
        acc_unit=node.choice("acc_unit", tuple(ACC_UNITS), "unknown_unit"),
        gyr_unit=node.choice("gyr_unit", tuple(GYR_UNITS), "unknown_unit"),
        mag_unit=node.text("mag_unit"),
        gravity_included=True if gravity is None else gravity,
        columns=MappingProxyType({k: _channels(columns.child(k)) for k in columns.keys}),
        quat_order=node.choice("quat_order", QUAT_ORDERS, "manifest_bad_value"),
        frame=frame,
    )


def _channels(node: _Node) -> Channels:
    node.only("acc", "gyr", "mag", "quat")
    acc = node.names("acc", 3)
    if acc is None:
        raise ManifestError(
            "manifest_bad_value", f"{node.path}.acc is missing; name three columns (x, y, z)."
        )
    return Channels(acc, node.names("gyr", 3), node.names("mag", 3), node.names("quat", 4))


class _Node:
    """One place in the JSON tree that knows its own path."""

    def __init__(self, value: object, path: str) -> None:
        if value is not None and not isinstance(value, dict):
            raise ManifestError(
                "manifest_bad_value", f"{path or 'The manifest'} is {_kind(value)}; expected an object."
            )
        self.value: dict[str, object] = value or {}
        self.path = path

    @property
    def keys(self) -> tuple[str, ...]:
        return tuple(self.value)

    def at(self, key: str) -> str:
        return f"{self.path}.{key}" if self.path else key

    def only(self, *allowed: str) -> None:
        for key in self.value:
            if key not in allowed:
                near = difflib.get_close_matches(key, allowed, 1)
                hint = f"did you mean '{near[0]}'?" if near else f"known here: {', '.join(allowed)}."
                raise ManifestError("manifest_unknown_key", f"{self.at(key)} is not known; {hint}")

    def child(self, key: str) -> _Node:
        return _Node(self.value.get(key), self.at(key))

    def children(self, key: str) -> list[_Node]:
        value = self.value.get(key)
        if value is not None and not isinstance(value, list):
            raise ManifestError("manifest_bad_value", f"{self.at(key)} is {_kind(value)}; expected a list.")
        return [_Node(v, f"{self.at(key)}[{i}]") for i, v in enumerate(value or [])]

    def text(self, key: str) -> str | None:
        value = self.value.get(key)
        if value is not None and (not isinstance(value, str) or not value.strip()):
            raise self._wrong(key, "a text")
        return value

    def string(self, key: str) -> str:
        value = self.text(key)
        if value is None:
            raise self._wrong(key, "a text")
        return value

    def number(self, key: str) -> float | None:
        value = self.value.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e12:
            raise self._wrong(key, "a number")
        return float(value)

    def count(self, key: str, default: int, most: int) -> int:
        value = self.value.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
            raise self._wrong(key, f"a whole number from 0 to {most}")
        return value

    def flag(self, key: str) -> bool | None:
        value = self.value.get(key)
        if value is not None and not isinstance(value, bool):
            raise self._wrong(key, "true or false")
        return value

    def choice(self, key: str, allowed: tuple[str, ...], code: str) -> str | None:
        value = self.text(key)
        if value is not None and value not in allowed:
            options = ", ".join(repr(a) for a in allowed)
            raise ManifestError(code, f"{self.at(key)} is '{value}'; expected one of {options}.")
        return value

    def names(self, key: str, n: int) -> tuple[str, ...] | None:
        value = self.value.get(key)
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != n or not all(isinstance(v, str) and v for v in value):
            raise self._wrong(key, f"a list of {n} column names")
        if len(set(value)) != n:
            raise self._wrong(key, f"a list of {n} different column names")
        return tuple(value)

    def _wrong(self, key: str, expected: str) -> ManifestError:
        return ManifestError(
            "manifest_bad_value", f"{self.at(key)} is {_kind(self.value.get(key))}; expected {expected}."
        )


def _kind(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 40 else text[:37] + "..."


def _no_constant(name: str) -> object:
    raise ValueError(f"{name} is not a number in JSON; use null")


def _unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    out: dict[str, object] = {}
    for key, value in pairs:
        if key in out:
            raise ValueError(f"the key '{key}' is given twice")
        out[key] = value
    return out
