"""Recordings: frozen objects, validated at construction, SI units.

`Recording` is the content of the files (each sensor on its own clock); `UniformRecording` is the same
recording on one time axis with a validity mask per sensor (made by core/timeline). All later stages use the
latter.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from types import MappingProxyType
from typing import Final

import numpy as np

from sagittal.core.errors import Notice, ParameterError, SignalError
from sagittal.core.frames import PROTOCOLS, SEGMENTS, Bools, Floats, Protocol, Segment
from sagittal.core.message import Message
from sagittal.core.signals.held_samples import HoldsSamples, hold_samples
from sagittal.core.signals.sample_blocks import LongStream, SampleBlock
from sagittal.core.subject.anthropometry import BodyMeasures
from sagittal.core.subject.shoe import Shoe
from sagittal.core.subject.standing_angles import check_standing


def _frozen(a: Floats | Bools | None, name: str, shape: tuple[int | None, ...], label: str) -> None:
    """Check shape and type of an array once and make it read-only."""
    if a is None:
        return
    if a.ndim != len(shape) or any(
        want is not None and got != want for got, want in zip(a.shape, shape, strict=True)
    ):
        raise ParameterError(
            "bad_shape",
            Message(
                "{where}: {name} has shape {shape}, expected {shape2}.",
                where=label,
                name=name,
                shape=a.shape,
                shape2=shape,
            ),
        )
    a.setflags(write=False)


BELT_MPS: Final = (0.05, 5.0)
"""Speeds a treadmill can have."""


def check_belt(belt_speed_mps: float | None, protocol: Protocol) -> None:
    """Reject an implausible belt speed, or one without a treadmill.

    Raises
    ------
    ParameterError `belt_speed_implausible`, `belt_speed_without_treadmill`.
    """
    if belt_speed_mps is None:
        return
    if not BELT_MPS[0] <= belt_speed_mps <= BELT_MPS[1]:
        raise ParameterError(
            "belt_speed_implausible",
            Message(
                "Belt speed {belt_speed_mps:g} m/s is outside {BELT_MPS:g} to {BELT_MPS2:g} m/s; "
                "give it in metres per second (3.6 km/h is 1 m/s).",
                belt_speed_mps=belt_speed_mps,
                BELT_MPS=BELT_MPS[0],
                BELT_MPS2=BELT_MPS[1],
            ),
        )
    if protocol != "treadmill":
        raise ParameterError(
            "belt_speed_without_treadmill",
            Message(
                "A belt speed is given, but the protocol is '{protocol}'; set it to treadmill or "
                "leave the speed out.",
                protocol=protocol,
            ),
        )


@dataclass(frozen=True)
class Subject:
    """The person measured; None for items not given.

    Parameters
    ----------
    height_m : body height, 0.5 to 2.5 m.
    standing_width_m : distance between the ankle centres in initial standing, 0 to 0.8 m.
        standing_angles_deg : goniometer joint angles in that posture, names as
        `sagittal.core.subject.standing_angles.NAMES`.
    shoe : the shape of its sole. measures : tape-measured body lengths.
    """

    height_m: float | None = None
    standing_width_m: float | None = None
    standing_angles_deg: Mapping[str, float] = field(default_factory=dict, hash=False)
    shoe: Shoe | None = None
    measures: BodyMeasures = field(default_factory=BodyMeasures)

    def __post_init__(self) -> None:
        if self.height_m is not None and not 0.5 <= self.height_m <= 2.5:
            raise ParameterError(
                "height_implausible",
                Message(
                    "Body height {height_m:g} m is outside 0.5 to 2.5 m; give it in metres.",
                    height_m=self.height_m,
                ),
            )
        if self.standing_width_m is not None and not 0.0 <= self.standing_width_m <= 0.8:
            raise ParameterError(
                "standing_width_implausible",
                Message(
                    "Ankles {standing_width_m:g} m apart while standing is outside 0 to 0.8 m; give the "
                    "distance of their middles in metres.",
                    standing_width_m=self.standing_width_m,
                ),
            )
        check_standing(self.standing_angles_deg)
        object.__setattr__(self, "standing_angles_deg", MappingProxyType(dict(self.standing_angles_deg)))

    def complete_from(self, other: Subject) -> Subject:
        """This subject, with missing items taken from `other`."""
        height, width = self.height_m, self.standing_width_m
        return Subject(
            other.height_m if height is None else height,
            other.standing_width_m if width is None else width,
            {**other.standing_angles_deg, **self.standing_angles_deg},
            self.shoe or other.shoe,
            self.measures.complete_from(other.measures),
        )

    def to_json(self) -> dict[str, object]:
        """Plain values, keys as in a manifest's `subject`."""
        return {
            "height_m": self.height_m,
            "standing_width_m": self.standing_width_m,
            "standing_angles_deg": dict(self.standing_angles_deg),
            "shoe": None if self.shoe is None else asdict(self.shoe),
            "measures": self.measures.to_json(),
        }


@hold_samples("acc", "gyr", "mag", "quat")
@dataclass(frozen=True, eq=False)
class ImuStream(HoldsSamples):
    """One sensor as given in its file, in SI units, on its own clock; missing samples are NaN rows.

    Parameters
    ----------
    device_id : serial number or column label, unique in a recording.
    source : name of its file.
    t_s : (n,) seconds, strictly increasing. From a packet counter (unwrapped) or the device clock.
        Streams of one recording that share `clock` share the origin of `t_s`.
    acc : (n, 3) specific force, m/s². gyr : (n, 3) rad/s or None. mag : (n, 3) any unit or None.
    quat : (n, 4) vendor orientation, scalar first, for comparison only, or None.
    rate_hz : nominal sampling rate.
    clock : source of `t_s`: "counter" (shared packet counter), "device" (own clock), "index".
    digest : of the signal values, to detect the same stream under two ids. notices : assumptions and problems
        of the reader.
    """

    device_id: str
    source: str
    t_s: Floats
    acc: Floats
    gyr: Floats | None
    mag: Floats | None
    quat: Floats | None
    rate_hz: float
    clock: str
    digest: str
    notices: tuple[Notice, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.t_s)
        if n == 0:
            raise SignalError(
                "empty", Message("“{source}”: no samples.", source=self.source), sensor=self.device_id
            )
        for name, a, shape in (
            ("t_s", self.t_s, (n,)),
            ("acc", self.held("acc"), (n, 3)),
            ("gyr", self.held("gyr"), (n, 3)),
            ("mag", self.held("mag"), (n, 3)),
            ("quat", self.held("quat"), (n, 4)),
        ):
            _frozen(a, name, shape, self.source)
        if np.any(self.t_s[1:] <= self.t_s[:-1]):
            raise SignalError(
                "time_not_increasing",
                Message("“{source}”: time does not increase.", source=self.source),
                sensor=self.device_id,
            )


@dataclass(frozen=True)
class GivenLimits:
    """Manually given start and end of a functional test, s; None = as detected.

    Raises
    ------
    ParameterError `test_limits` if a time is below 0 or the end is not after the start.
    """

    start_s: float | None = None
    end_s: float | None = None

    def __post_init__(self) -> None:
        times = [t for t in (self.start_s, self.end_s) if t is not None]
        if any(not 0.0 <= t < float("inf") for t in times) or times != sorted(set(times)):
            raise ParameterError(
                "test_limits",
                Message(
                    "A test from {start_s} s to {end_s} s; expected times of 0 or more, the end after the "
                    "start.",
                    start_s=self.start_s,
                    end_s=self.end_s,
                ),
            )


BLOCK_ROWS: Final = 1 << 16
"""Rows of a block where nothing else says how long it is."""


def as_long_stream(stream: ImuStream, rows: int = BLOCK_ROWS) -> LongStream:
    """A stream in memory, read in blocks of this many rows."""

    def open_blocks() -> Iterator[SampleBlock]:
        for i in range(0, len(stream.t_s), rows):
            part = slice(i, i + rows)
            gyr = None if stream.held("gyr") is None else stream.cut("gyr", part)
            yield SampleBlock(stream.t_s[part] - stream.t_s[0], stream.cut("acc", part), gyr)

    return LongStream(
        device_id=stream.device_id,
        source=stream.source,
        rate_hz=stream.rate_hz,
        has_gyro=stream.held("gyr") is not None,
        duration_s=float(stream.t_s[-1] - stream.t_s[0]),
        open_blocks=open_blocks,
        notices=stream.notices,
    )


@dataclass(frozen=True, eq=False)
class Recording:
    """One recording: streams by device id, and the segment of each.

    Parameters
    ----------
    streams : device id → stream.
    segments : device id → segment, None = not used. Ids without an entry are unassigned (see `unassigned`).
    mounting : segment → declared placement, free text ("sacrum, face backwards").
    sha256 : file name → sha256 of the source bytes.
    belt_speed_mps : of a treadmill, None = not entered.
    test_limits : of a functional test, corrected manually.
    long : device id → sensor read block by block, which may be missing among the streams.
    """

    streams: Mapping[str, ImuStream]
    segments: Mapping[str, Segment | None]
    subject: Subject = field(default_factory=Subject)
    protocol: Protocol = "walk"
    mounting: Mapping[str, str] = field(default_factory=dict)
    sha256: Mapping[str, str] = field(default_factory=dict)
    notices: tuple[Notice, ...] = ()
    belt_speed_mps: float | None = None
    test_limits: GivenLimits = field(default_factory=GivenLimits)
    long: Mapping[str, LongStream] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_belt(self.belt_speed_mps, self.protocol)
        if self.protocol not in PROTOCOLS:
            raise ParameterError(
                "unknown_protocol",
                Message(
                    "Protocol '{protocol}' is not one of {PROTOCOLS}.",
                    protocol=self.protocol,
                    PROTOCOLS=", ".join(PROTOCOLS),
                ),
            )
        devices: dict[str, str] = {}
        for device, segment in self.segments.items():
            if segment is None:
                continue
            if segment not in SEGMENTS:
                raise ParameterError(
                    "unknown_segment",
                    Message(
                        "Sensor {device} is mapped to '{segment}'; expected {SEGMENTS} or null.",
                        device=device,
                        segment=segment,
                        SEGMENTS=", ".join(SEGMENTS),
                    ),
                    sensor=device,
                )
            if segment in devices:
                raise ParameterError(
                    "duplicate_segment",
                    Message(
                        "Sensors {segment} and {device} are both mapped to {segment2}; choose one.",
                        segment=devices[segment],
                        device=device,
                        segment2=segment,
                    ),
                    sensor=device,
                )
            devices[segment] = device
        for name in ("streams", "segments", "mounting", "sha256", "long"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @property
    def unassigned(self) -> tuple[str, ...]:
        """Device ids neither assigned to a segment nor excluded."""
        return tuple(d for d in dict.fromkeys((*self.streams, *self.long)) if d not in self.segments)


@hold_samples("acc", "gyr", "mag")
@dataclass(frozen=True, eq=False)
class SensorSignals(HoldsSamples):
    """One sensor on the uniform axis.

    Parameters
    ----------
    acc, gyr : (n, 3) m/s², rad/s; finite everywhere (invalid samples hold the last value).
    mag : (n, 3) or None.
    valid : (n,) measured or interpolated over ≤ 0.1 s. interpolated : (n,) filled, flagged.
    """

    device_id: str
    acc: Floats
    gyr: Floats
    mag: Floats | None
    valid: Bools
    interpolated: Bools

    def __post_init__(self) -> None:
        acc, gyr = self.held("acc"), self.held("gyr")
        n = len(acc)
        for name, a, shape in (
            ("acc", acc, (n, 3)),
            ("gyr", gyr, (n, 3)),
            ("mag", self.held("mag"), (n, 3)),
            ("valid", self.valid, (n,)),
            ("interpolated", self.interpolated, (n,)),
        ):
            _frozen(a, name, shape, self.device_id)
        if not (np.isfinite(acc).all() and np.isfinite(gyr).all()):
            raise SignalError(
                "bad_signal",
                Message("{device_id}: non-finite samples left.", device_id=self.device_id),
                sensor=self.device_id,
            )


@dataclass(frozen=True, eq=False)
class UniformRecording:
    """A recording on one uniform time axis, by segment.

    Parameters
    ----------
    t_s : (n,) seconds from recording start, step 1 / rate_hz.
    sensors : segment → signals, all of length n. belt_speed_mps : of a treadmill, None = not entered.
    """

    t_s: Floats
    rate_hz: float
    sensors: Mapping[Segment, SensorSignals]
    subject: Subject
    protocol: Protocol
    mounting: Mapping[str, str]
    notices: tuple[Notice, ...] = ()
    belt_speed_mps: float | None = None

    def __post_init__(self) -> None:
        _frozen(self.t_s, "t_s", (None,), "UniformRecording")
        for segment, s in self.sensors.items():
            if len(s.valid) != len(self.t_s):
                raise ParameterError(
                    "bad_shape",
                    Message(
                        "{segment} has {valid} samples, the axis {t_s}.",
                        segment=segment,
                        valid=len(s.valid),
                        t_s=len(self.t_s),
                    ),
                    sensor=segment,
                )
        object.__setattr__(self, "sensors", MappingProxyType(dict(self.sensors)))
