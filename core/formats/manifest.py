"""The manifest: information that the files do not contain (docs/reference/formats.md).

Parsed by hand instead of with a schema library: core depends only on numpy and scipy, and a message must name
the exact place ("sources[0].columns.foot_l.acc") and the expected content.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from sagittal.core.errors import ManifestError, ParameterError
from sagittal.core.formats.aliases import segment_named
from sagittal.core.formats.json_tree import JsonNode, read_json
from sagittal.core.formats.source_spec import SourceSpec, read_source
from sagittal.core.frames import PROTOCOLS, SEGMENTS, Protocol, Segment
from sagittal.core.signals.correction import AS_READ, SensorCorrection
from sagittal.core.signals.recording import GivenLimits, Subject, check_belt
from sagittal.core.subject.anthropometry import LIMITS, BodyMeasures
from sagittal.core.subject.shoe import Shoe

MAX_BYTES: Final = 1_000_000
"""A manifest is a page of text; more is a mistake."""


@dataclass(frozen=True)
class Manifest:
    """Declarations about a recording.

    Parameters
    ----------
    sensors : device id → segment, None = ignore this sensor.
    protocol : None = not given (walk). belt_speed_mps : of a treadmill.
    corrections : device id → correction of errors in its file.
    test_limits : manually given start and end of a functional test.
    """

    subject: Subject = field(default_factory=Subject)
    protocol: Protocol | None = None
    mounting: Mapping[str, str] = field(default_factory=dict)
    sensors: Mapping[str, Segment | None] = field(default_factory=dict)
    sources: tuple[SourceSpec, ...] = ()
    belt_speed_mps: float | None = None
    corrections: Mapping[str, SensorCorrection] = field(default_factory=dict)
    test_limits: GivenLimits = field(default_factory=GivenLimits)

    def source_of(self, name: str) -> SourceSpec | None:
        """First entry of `sources` that covers a file."""
        return next((s for s in self.sources if s.covers(name)), None)

    def complete_from(self, other: Manifest) -> Manifest:
        """This manifest, with undeclared items taken from another.

        `sensors` are taken as a whole, since either of them defines the complete assignment; everything else
        item by item. A belt speed belongs to its protocol.
        """
        protocol = self.protocol or other.protocol
        belt = other.belt_speed_mps if other.protocol == protocol else None
        return Manifest(
            subject=self.subject.complete_from(other.subject),
            protocol=protocol,
            mounting=MappingProxyType({**other.mounting, **self.mounting}),
            sensors=self.sensors or other.sensors,
            sources=(*self.sources, *other.sources),
            belt_speed_mps=self.belt_speed_mps if self.belt_speed_mps is not None else belt,
            corrections=MappingProxyType({**other.corrections, **self.corrections}),
            test_limits=self.test_limits if self.test_limits != GivenLimits() else other.test_limits,
        )


KEYS: Final = frozenset(
    {"sensors", "sources", "subject", "protocol", "mounting", "belt_speed_mps", "corrections", "test_limits"}
)


def is_manifest(value: object) -> bool:
    """Whether a JSON value is intended to be a manifest."""
    return isinstance(value, dict) and bool(value.keys() & KEYS)


def parse_manifest(data: bytes) -> Manifest:
    """Parse a manifest from JSON text.

    Raises
    ------
    ManifestError manifest_bad_json, manifest_unknown_key, manifest_bad_value, unknown_segment,
        duplicate_segment, unknown_protocol, height_implausible, standing_width_implausible, unknown_angle,
        standing_angle_implausible, shoe_implausible, unknown_unit, belt_speed_implausible,
        belt_speed_without_treadmill, correction_implausible; the message names the path inside the manifest.
    """
    try:
        root = read_json(data, MAX_BYTES)
    except ValueError as e:
        raise ManifestError("manifest_bad_json", f"The manifest is not valid JSON: {e}.") from e
    return manifest_of(root)


def manifest_of(root: object) -> Manifest:
    """Build a manifest from decoded JSON; errors as in `parse_manifest`."""
    top = JsonNode(root, "")
    top.only(
        "subject",
        "protocol",
        "mounting",
        "sensors",
        "sources",
        "belt_speed_mps",
        "corrections",
        "test_limits",
    )
    subject = top.child("subject")
    subject_info = _subject(subject)
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
        subject=subject_info,
        protocol=protocol,
        mounting=MappingProxyType({_segment(k, f"mounting.{k}"): mounting.string(k) for k in mounting.keys}),
        sensors=MappingProxyType(_sensors(sensors)),
        sources=tuple(read_source(n) for n in top.children("sources")),
        belt_speed_mps=belt,
        corrections=_corrections(top.child("corrections")),
        test_limits=_limits(top.child("test_limits")),
    )


def _limits(node: JsonNode) -> GivenLimits:
    node.only("start_s", "end_s")
    try:
        return GivenLimits(node.number("start_s"), node.number("end_s"))
    except ParameterError as error:
        raise ManifestError(error.code, f"test_limits: {error.message}") from error


def _corrections(node: JsonNode) -> Mapping[str, SensorCorrection]:
    return MappingProxyType({device: _correction(node.child(device)) for device in node.keys})


def _correction(node: JsonNode) -> SensorCorrection:
    node.only("acc_axes", "gyr_axes", "acc_times", "gyr_times")
    acc, gyr = node.number("acc_times"), node.number("gyr_times")
    try:
        return SensorCorrection(
            node.names("acc_axes", 3) or AS_READ,
            node.names("gyr_axes", 3) or AS_READ,
            1.0 if acc is None else acc,
            1.0 if gyr is None else gyr,
        )
    except ParameterError as error:
        raise ManifestError(error.code, f"{node.path}: {error.message}") from error


def _subject(node: JsonNode) -> Subject:
    node.only("height_m", "standing_width_m", "standing_angles_deg", "shoe", "measures")
    standing = node.child("standing_angles_deg")
    angles = {name: value for name in standing.keys if (value := standing.number(name)) is not None}
    try:
        return Subject(
            node.number("height_m"),
            node.number("standing_width_m"),
            angles,
            _shoe(node.child("shoe")),
            _measures(node.child("measures")),
        )
    except ParameterError as error:
        key = _SUBJECT_KEYS[error.code]
        raise ManifestError(error.code, f"subject.{key}: {error.message}") from error


def _measures(node: JsonNode) -> BodyMeasures:
    node.only(*LIMITS)
    return BodyMeasures(**{name: node.number(name) for name in LIMITS})


def _shoe(node: JsonNode) -> Shoe | None:
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
    "length_implausible": "measures",
}
"""What `Subject` refuses → where the manifest says it."""


def _sensors(node: JsonNode) -> dict[str, Segment | None]:
    out: dict[str, Segment | None] = {}
    devices: dict[str, str] = {}
    for device in node.keys:
        name = node.text(device)
        if name is None:
            out[device] = None
            continue
        segment = _segment(name, f"sensors.{device}")
        if segment in devices:
            raise ManifestError(
                "duplicate_segment",
                f"sensors.{device}: {segment} is already given to {devices[segment]}; "
                "choose one, the other is null or another segment.",
                sensor=device,
            )
        devices[segment] = device
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
