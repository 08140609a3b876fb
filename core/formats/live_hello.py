"""First message of a live tablet: its device clocks and the sensors on each.

docs/reference/live-protocol.md, `hello`. The token is read with it and is never compared or stored.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal, cast, get_args

from sagittal.core.errors import InputError
from sagittal.core.formats.json_tree import read_json
from sagittal.core.frames import SEGMENTS, Segment

PROTOCOL: Final = "sagittal.live.v1"
MOST_STREAMS: Final = 64
MOST_SENSORS: Final = 64
LONGEST_TEXT: Final = 200
"""Of an id, a take or a token: more is a mistake."""
RATES_HZ: Final = (1.0, 10_000.0)
MOST_HELLO_BYTES: Final = 1 << 16

Clock = Literal["shared", "own"]
Source = Literal["dot", "device_motion", "replay", "cli"]


@dataclass(frozen=True)
class SensorInfo:
    """One sensor.

    Parameters
    ----------
    segment : None = not used. acc_range : m/s², gyr_range : rad/s, None = not given.
    """

    id: str
    segment: Segment | None
    acc_range: float | None = None
    gyr_range: float | None = None


@dataclass(frozen=True)
class StreamInfo:
    """Sensors that are sampled together.

    Parameters
    ----------
    stream : its number in the batches.
    clock : "shared": all streams with this value tick together; "own": aligned by the sending times of its
        batches.
    """

    stream: int
    rate_hz: float
    clock: Clock
    sensors: tuple[SensorInfo, ...]


@dataclass(frozen=True)
class Hello:
    """The streams of a recording; equality ignores the token."""

    take: str
    source: Source
    streams: tuple[StreamInfo, ...]
    token: str = field(default="", compare=False, repr=False)

    def stream(self, number: int) -> StreamInfo:
        """The stream with a number.

        Raises
        ------
        InputError `batch_stream`.
        """
        for info in self.streams:
            if info.stream == number:
                return info
        numbers = ", ".join(str(s.stream) for s in self.streams)
        raise InputError("batch_stream", f"Stream {number} is not in the hello; it names {numbers}.")

    @property
    def sensors(self) -> tuple[SensorInfo, ...]:
        """All sensors, in the order of the streams."""
        return tuple(sensor for stream in self.streams for sensor in stream.sensors)


def parse_hello(data: bytes | str) -> Hello:
    """Parse a hello from JSON; unknown keys are ignored.

    Raises
    ------
    InputError `hello_bad_json`, `hello_bad_value`, `hello_protocol`, `unknown_segment`, `duplicate_segment`,
    `duplicate_device`; the message names the path.
    """
    try:
        root = read_json(data, MOST_HELLO_BYTES)
    except ValueError as e:
        raise InputError("hello_bad_json", f"The hello is not valid JSON: {e}.") from e
    return hello_of(root)


def hello_of(root: object) -> Hello:
    """Build a hello from decoded JSON; errors as in `parse_hello`."""
    top = _object(root, "hello")
    if top.get("type") != "hello" or top.get("protocol") != PROTOCOL:
        raise InputError(
            "hello_protocol",
            f"The first message is {top.get('type')!r} of protocol {top.get('protocol')!r}; expected a hello "
            f"of '{PROTOCOL}'. Update the sender.",
        )
    streams = tuple(
        _stream(x, f"streams[{i}]") for i, x in enumerate(_list(top, "streams", "streams", MOST_STREAMS))
    )
    hello = Hello(
        take=_text(top, "take", "take"),
        source=cast("Source", _choice(top, "source", "source", get_args(Source))),
        streams=streams,
        token=_text(top, "token", "token") if top.get("token") is not None else "",
    )
    _refuse_twice(hello)
    return hello


def hello_json(hello: Hello, token: str | None = None) -> bytes:
    """Canonical JSON; with a token as sent by the tablet, without as stored in the log."""
    root: dict[str, object] = {
        "type": "hello",
        "protocol": PROTOCOL,
        "take": hello.take,
        "source": hello.source,
        "streams": [
            {
                "stream": s.stream,
                "rate_hz": s.rate_hz,
                "clock": s.clock,
                "sensors": [
                    {"id": x.id, "segment": x.segment, "acc_range": x.acc_range, "gyr_range": x.gyr_range}
                    for x in s.sensors
                ],
            }
            for s in hello.streams
        ],
    }
    if token is not None:
        root["token"] = token
    return json.dumps(root, ensure_ascii=False, sort_keys=True, separators=(",", ":")).encode()


def _stream(value: object, path: str) -> StreamInfo:
    node = _object(value, path)
    number = node.get("stream")
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < 1 << 16:
        raise _wrong(f"{path}.stream", number, "a whole number from 0 to 65535")
    rate = _number(node, "rate_hz", f"{path}.rate_hz")
    if rate is None or not RATES_HZ[0] <= rate <= RATES_HZ[1]:
        raise _wrong(f"{path}.rate_hz", node.get("rate_hz"), "1 to 10000 samples/s")
    sensors = _list(node, "sensors", f"{path}.sensors", MOST_SENSORS)
    return StreamInfo(
        stream=number,
        rate_hz=rate,
        clock=cast("Clock", _choice(node, "clock", f"{path}.clock", get_args(Clock))),
        sensors=tuple(_sensor(x, f"{path}.sensors[{i}]") for i, x in enumerate(sensors)),
    )


def _sensor(value: object, path: str) -> SensorInfo:
    node = _object(value, path)
    segment = node.get("segment")
    if segment is not None and segment not in SEGMENTS:
        raise InputError(
            "unknown_segment",
            f"{path}.segment: {segment!r} is no segment; expected one of {', '.join(SEGMENTS)} or null.",
        )
    ranges = [_number(node, name, f"{path}.{name}") for name in ("acc_range", "gyr_range")]
    for name, x in zip(("acc_range", "gyr_range"), ranges, strict=True):
        if x is not None and x <= 0:
            raise _wrong(f"{path}.{name}", x, "above 0, or null")
    return SensorInfo(_text(node, "id", f"{path}.id"), cast("Segment | None", segment), ranges[0], ranges[1])


def _refuse_twice(hello: Hello) -> None:
    numbers = [s.stream for s in hello.streams]
    if len(set(numbers)) != len(numbers):
        raise InputError("hello_bad_value", f"Two streams have the same number: {numbers}.")
    if len(hello.sensors) > MOST_SENSORS:
        raise InputError(
            "hello_bad_value", f"{len(hello.sensors)} sensors, at most {MOST_SENSORS} are taken."
        )
    ids: set[str] = set()
    devices: dict[str, str] = {}
    for x in hello.sensors:
        if x.id in ids:
            raise InputError("duplicate_device", f"Sensor {x.id} is named twice.", sensor=x.id)
        ids.add(x.id)
        if x.segment is not None and x.segment in devices:
            raise InputError(
                "duplicate_segment",
                f"Sensors {devices[x.segment]} and {x.id} are both worn on {x.segment}; choose one.",
                sensor=x.id,
            )
        if x.segment is not None:
            devices[x.segment] = x.id


def _object(value: object, path: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise _wrong(path, value, "an object")
    return value


def _list(node: Mapping[str, Any], key: str, path: str, most: int) -> list[object]:
    value = node.get(key)
    if not isinstance(value, list) or not 1 <= len(value) <= most:
        raise _wrong(path, value, f"a list of 1 to {most}")
    return value


def _text(node: Mapping[str, Any], key: str, path: str) -> str:
    value = node.get(key)
    # isprintable: neither line breaks nor lone surrogates, which JSON can carry and UTF-8 cannot
    plain = isinstance(value, str) and value.isprintable() and bool(value.strip())
    if not isinstance(value, str) or not plain or len(value) > LONGEST_TEXT:
        raise _wrong(path, value, f"a text of 1 to {LONGEST_TEXT} printable characters")
    return value


def _choice(node: Mapping[str, Any], key: str, path: str, allowed: tuple[str, ...]) -> str:
    value = node.get(key)
    if value not in allowed:
        raise _wrong(path, value, f"one of {', '.join(allowed)}")
    return str(value)


def _number(node: Mapping[str, Any], key: str, path: str) -> float | None:
    value = node.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e12:
        raise _wrong(path, value, "a number")
    return float(value)


def _wrong(path: str, value: object, expected: str) -> InputError:
    text = repr(value)
    text = text if len(text) <= 40 else text[:37] + "..."
    return InputError("hello_bad_value", f"{path} is {text}; expected {expected}.")
