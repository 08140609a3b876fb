"""The manifest: what the files cannot say themselves (docs/formats.md).

Parsed by hand instead of by a schema library: core knows only numpy and scipy, and a message must name the
exact place ("sources[0].columns.foot_l.acc") and what would be right there.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import Final

from core.errors import ManifestError, ParameterError
from core.formats.aliases import segment_named
from core.formats.json_tree import Node, no_constant, unique
from core.frames import GRAVITY, PROTOCOLS, SEGMENTS, Protocol, Segment
from core.recording import Subject, check_belt
from core.shoe import Shoe

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
    protocol : None = not said (walk). belt_speed_mps : of a treadmill.
    """

    subject: Subject = field(default_factory=Subject)
    protocol: Protocol | None = None
    mounting: Mapping[str, str] = field(default_factory=dict)
    sensors: Mapping[str, Segment | None] = field(default_factory=dict)
    sources: tuple[SourceSpec, ...] = ()
    belt_speed_mps: float | None = None

    def source_of(self, name: str) -> SourceSpec | None:
        """First entry of `sources` that covers a file."""
        return next((s for s in self.sources if s.covers(name)), None)


def is_manifest(value: object) -> bool:
    """Tell whether a JSON value means to be a manifest."""
    return isinstance(value, dict) and bool(
        value.keys() & {"sensors", "sources", "subject", "protocol", "mounting", "belt_speed_mps"}
    )


def parse_manifest(data: bytes) -> Manifest:
    """Read a manifest from JSON text.

    Raises
    ------
    ManifestError
        manifest_bad_json, manifest_unknown_key, manifest_bad_value, unknown_segment, duplicate_segment,
        unknown_protocol, height_implausible, standing_width_implausible, unknown_angle,
        standing_angle_implausible, shoe_implausible, unknown_unit, belt_speed_implausible,
        belt_speed_without_treadmill; the message names the path inside the manifest.
    """
    if len(data) > MAX_BYTES:
        raise ManifestError(
            "manifest_bad_json", f"The manifest has {len(data)} bytes, at most {MAX_BYTES} make sense."
        )
    try:
        root = json.loads(data.decode("utf-8-sig"), parse_constant=no_constant, object_pairs_hook=unique)
    except (ValueError, RecursionError) as e:
        raise ManifestError("manifest_bad_json", f"The manifest is not valid JSON: {e}.") from e
    return manifest_of(root)


def manifest_of(root: object) -> Manifest:
    """Build a manifest from decoded JSON; errors as in `parse_manifest`."""
    top = Node(root, "")
    top.only("subject", "protocol", "mounting", "sensors", "sources", "belt_speed_mps")
    subject = top.child("subject")
    who = _subject(subject)
    protocol = top.text("protocol")
    if protocol is not None and protocol not in PROTOCOLS:
        raise ManifestError(
            "unknown_protocol", f"protocol is '{protocol}'; expected one of {', '.join(PROTOCOLS)}."
        )
    belt = top.number("belt_speed_mps")
    try:
        check_belt(belt, protocol or "treadmill")
    except ParameterError as error:
        raise ManifestError(error.code, f"belt_speed_mps: {error.message}") from error
    mounting = top.child("mounting")
    sensors = top.child("sensors")
    return Manifest(
        subject=who,
        protocol=protocol,
        mounting=MappingProxyType({_segment(k, f"mounting.{k}"): mounting.string(k) for k in mounting.keys}),
        sensors=MappingProxyType(_sensors(sensors)),
        sources=tuple(_source(n) for n in top.children("sources")),
        belt_speed_mps=belt,
    )


def _subject(node: Node) -> Subject:
    node.only("height_m", "standing_width_m", "standing_angles_deg", "shoe")
    standing = node.child("standing_angles_deg")
    angles = {name: value for name in standing.keys if (value := standing.number(name)) is not None}
    try:
        return Subject(
            node.number("height_m"), node.number("standing_width_m"), angles, _shoe(node.child("shoe"))
        )
    except ParameterError as error:
        key = _SUBJECT_KEYS[error.code]
        raise ManifestError(error.code, f"subject.{key}: {error.message}") from error


def _shoe(node: Node) -> Shoe | None:
    node.only("back_m", "front_m", "tip_up_m")
    if not node.keys:
        return None
    back, front = node.number("back_m"), node.number("front_m")
    if back is None or front is None:
        raise ManifestError("manifest_bad_value", f"{node.path} needs both back_m and front_m, or neither.")
    return Shoe(back, front, node.number("tip_up_m") or 0.0)


_SUBJECT_KEYS: Final = {
    "height_implausible": "height_m",
    "standing_width_implausible": "standing_width_m",
    "unknown_angle": "standing_angles_deg",
    "standing_angle_implausible": "standing_angles_deg",
    "shoe_implausible": "shoe",
}
"""What `Subject` refuses → where the manifest says it."""


def _sensors(node: Node) -> dict[str, Segment | None]:
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


def _source(node: Node) -> SourceSpec:
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


def _channels(node: Node) -> Channels:
    node.only("acc", "gyr", "mag", "quat")
    acc = node.names("acc", 3)
    if acc is None:
        raise ManifestError(
            "manifest_bad_value", f"{node.path}.acc is missing; name three columns (x, y, z)."
        )
    return Channels(acc, node.names("gyr", 3), node.names("mag", 3), node.names("quat", 4))
