"""What a tablet says first and last: read back as it was, refused with the place where it is wrong."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from sagittal.core.errors import InputError
from sagittal.core.formats.live_log import (
    Finish,
    SensorInfo,
    StreamInfo,
    finish_json,
    hello_json,
    parse_finish,
    parse_hello,
)
from tests.helpers.live import SMALL_HELLO


def test_a_hello_comes_back_and_its_token_is_not_in_the_log() -> None:
    sent = parse_hello(hello_json(SMALL_HELLO, "secret"))
    assert sent == SMALL_HELLO
    assert sent.token == "secret"
    assert "secret" not in repr(sent)
    assert b"secret" not in hello_json(sent)
    assert parse_hello(hello_json(sent)).token == ""
    assert parse_hello(hello_json(SMALL_HELLO).decode()) == SMALL_HELLO


@pytest.mark.parametrize(
    ("path", "value", "code"),
    [
        ("type", "batch", "hello_protocol"),
        ("protocol", "sagittal.live.v2", "hello_protocol"),
        ("take", "", "hello_bad_value"),
        ("take", "x" * 300, "hello_bad_value"),
        ("take", 7, "hello_bad_value"),
        ("token", 7, "hello_bad_value"),
        ("source", "radio", "hello_bad_value"),
        ("streams", [], "hello_bad_value"),
        ("streams", [1], "hello_bad_value"),
        ("streams", {}, "hello_bad_value"),
        ("streams.0.stream", -1, "hello_bad_value"),
        ("streams.0.stream", 65_536, "hello_bad_value"),
        ("streams.0.stream", True, "hello_bad_value"),
        ("streams.0.rate_hz", 0, "hello_bad_value"),
        ("streams.0.rate_hz", 1e300, "hello_bad_value"),
        ("streams.0.rate_hz", 10**300, "hello_bad_value"),
        ("streams.0.rate_hz", 10**400, "hello_bad_json"),
        ("streams.0.rate_hz", "100", "hello_bad_value"),
        ("streams.0.clock", "wall", "hello_bad_value"),
        ("streams.0.clock", [], "hello_bad_value"),
        ("streams.0.sensors", [], "hello_bad_value"),
        ("streams.0.sensors.0.id", None, "hello_bad_value"),
        ("streams.0.sensors.0.segment", "tail", "unknown_segment"),
        ("streams.0.sensors.0.segment", ["pelvis"], "unknown_segment"),
        ("streams.0.sensors.0.acc_range", -1, "hello_bad_value"),
        ("streams.0.sensors.1.id", "A1", "duplicate_device"),
        ("streams.0.sensors.1.segment", "foot_l", "duplicate_segment"),
    ],
)
def test_a_hello_that_is_wrong_is_refused_with_the_place(path: str, value: object, code: str) -> None:
    root = json.loads(hello_json(SMALL_HELLO))
    node: dict[str, object] = root
    *way, last = path.split(".")
    for key in way:
        node = node[int(key) if key.isdigit() else key]  # type: ignore[index, assignment]
    node[last] = value
    with pytest.raises(InputError) as caught:
        parse_hello(json.dumps(root))
    assert caught.value.code == code


@pytest.mark.parametrize(
    "text", ["", "[]", "null", "{", '{"a": NaN}', '{"a":1,"a":2}', "[" * 9000, b"\xff\xfe", " " * 70_000]
)
def test_what_is_no_hello_is_refused(text: str | bytes) -> None:
    with pytest.raises(InputError):
        parse_hello(text)


def test_too_many_sensors_or_a_stream_named_twice_are_refused() -> None:
    many = tuple(
        StreamInfo(k, 60.0, "own", tuple(SensorInfo(f"{k}-{i}", None) for i in range(40))) for k in range(2)
    )
    for streams in (
        many,
        (SMALL_HELLO.streams[0], replace(SMALL_HELLO.streams[0], sensors=(SensorInfo("Z", None),))),
    ):
        with pytest.raises(InputError) as caught:
            parse_hello(hello_json(replace(SMALL_HELLO, streams=streams)))
        assert caught.value.code == "hello_bad_value"


def test_a_finish_comes_back_and_others_are_refused() -> None:
    sent = Finish(12, "0f" * 32)
    assert parse_finish(finish_json(sent)) == sent
    digest = '"sha256":"' + "0" * 64 + '"}'
    for wrong in ("{}", "[]", "x", '{"count":-1,' + digest, '{"count":true,' + digest, b"\xff",
                  '{"count":1,"sha256":"ZZ"}', '{"count":1,"sha256":7}'):  # fmt: skip
        with pytest.raises(InputError) as caught:
            parse_finish(wrong)
        assert caught.value.code == "finish_bad"
