"""A recording cut into batches and read back from their log is the same recording."""

from __future__ import annotations

import asyncio
import time
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.errors import InputError
from sagittal.core.formats.live_log import FILE_MARK, decode_batch, hello_json, parse_hello, record
from sagittal.core.formats.live_reader import read_live_log
from sagittal.core.frames import Floats
from sagittal.core.signals.recording import ImuStream, Recording
from sagittal.core.simulate import simulate_scenario
from sagittal.core.timeline import synchronise
from sagittal.server.live.playback import DueBatch, cut, hello_of, pace_batches
from tests.helpers.walks import neura_recording


def log_of(recording: Recording, batches: list[DueBatch]) -> bytes:
    hello = record("H", hello_json(hello_of(recording, "t")))
    return FILE_MARK + hello + b"".join(record("B", one.frame) for one in batches)


def imu(device: str, t_s: Floats, rate_hz: float = 50.0, gyr: bool = True) -> ImuStream:
    values = np.random.default_rng(len(t_s)).normal(size=(len(t_s), 6)).astype(np.float32).astype(float)
    return ImuStream(
        device, "f", t_s, values[:, :3].copy(), values[:, 3:].copy() if gyr else None, None, None, rate_hz,
        "device", device,
    )  # fmt: skip


def as_sent(x: Floats | None) -> Floats | None:
    return None if x is None else x.astype(np.float32).astype(float)


@pytest.mark.slow
@pytest.mark.parametrize("per_batch", [1, 7, 10, 1000])
def test_a_walk_comes_back_sample_by_sample(per_batch: int) -> None:
    walk = simulate_scenario("comfortable", 3).recording
    second = read_live_log(log_of(walk, cut(walk, per_batch)), "t")
    assert list(second.streams) == [d for d, s in walk.segments.items() if s is not None]
    first = min(s.t_s[0] for s in walk.streams.values())
    for device, stream in second.streams.items():
        initial_streams = walk.streams[device]
        stored_mask = np.isfinite(stream.acc).all(axis=1)
        np.testing.assert_allclose(stream.t_s[stored_mask], initial_streams.t_s - first, atol=1e-6)
        np.testing.assert_array_equal(stream.acc[stored_mask], as_sent(initial_streams.acc))
        np.testing.assert_array_equal(stream.gyr[stored_mask], as_sent(initial_streams.gyr))  # type: ignore[index]
        assert second.segments[device] == walk.segments[device]


@pytest.mark.recorded
def test_a_real_walk_gives_the_same_signals_on_the_axis_as_its_file() -> None:
    walk = neura_recording()
    batches = cut(walk, 10)
    assert [one.at_s for one in batches] == sorted(one.at_s for one in batches)
    second_variant = replace(
        read_live_log(log_of(walk, batches), "t"), subject=walk.subject, protocol=walk.protocol
    )
    ours, theirs = synchronise(second_variant), synchronise(walk)
    np.testing.assert_array_equal(ours.t_s, theirs.t_s)
    for segment, sensor in theirs.sensors.items():
        np.testing.assert_array_equal(ours.sensors[segment].acc, as_sent(sensor.acc))
        np.testing.assert_array_equal(ours.sensors[segment].gyr, as_sent(sensor.gyr))


def test_sensors_of_unequal_rates_and_irregular_times_become_streams_of_their_own() -> None:
    steady, slow = np.arange(200) / 100.0, 0.005 + np.arange(60) / 30.0
    wobbly = np.cumsum(np.random.default_rng(1).uniform(0.004, 0.02, 150))
    recording = Recording(
        {
            "a": imu("a", steady + 10.0, 100.0),
            "b": imu("b", slow + 10.0, 30.0),
            "c": imu("c", steady[5:150] + 10.0, 100.0, gyr=False),
            "d": imu("d", wobbly + 10.0, 100.0),
        },
        segments={},
    )
    streams = hello_of(recording, "t").streams
    assert [[x.id for x in s.sensors] for s in streams] == [["a", "c"], ["b"], ["d"]]
    batches = cut(recording, 16)
    assert [decode_batch(one.frame).seq for one in batches] == list(range(len(batches)))
    second = read_live_log(log_of(recording, batches), "t")
    for device, initial in recording.streams.items():
        stored_mask = np.isfinite(second.streams[device].acc).all(axis=1)
        np.testing.assert_allclose(second.streams[device].t_s[stored_mask], initial.t_s - 10.0, atol=1.1e-6)
        np.testing.assert_array_equal(second.streams[device].acc[stored_mask], initial.acc)
    assert second.streams["c"].gyr is None


def test_a_hole_in_all_sensors_is_not_sent() -> None:
    t = np.concatenate([np.arange(50), np.arange(500, 530)]) / 50.0
    recording = Recording({"a": imu("a", t)}, segments={"a": "pelvis"})
    batches = [decode_batch(one.frame) for one in cut(recording, 20)]
    assert [len(b.samples) for b in batches] == [20, 20, 10, 20, 10]
    assert [b.t0_us for b in batches] == [0, 400_000, 800_000, 10_000_000, 10_400_000]
    assert [b.sent_us for b in batches] == [380_000, 780_000, 980_000, 10_380_000, 10_580_000]


def test_only_sensors_with_a_place_are_sent_if_any_has_one() -> None:
    t = np.arange(100) / 50.0
    pair = Recording({"a": imu("a", t), "b": imu("b", t[1:])}, segments={"b": "pelvis", "a": None})
    assert [x.id for x in parse_hello(hello_json(hello_of(pair, "t"))).sensors] == ["b"]
    neither = replace(pair, segments={})
    assert [x.id for x in hello_of(neither, "t").sensors] == ["a", "b"]


@pytest.mark.parametrize("size", [0, 1001, -5])
def test_a_batch_size_that_is_not_possible_is_refused(size: int) -> None:
    recording = Recording({"a": imu("a", np.arange(10) / 50.0)}, segments={})
    with pytest.raises(InputError, match="1 to 1000"):
        cut(recording, size)


def test_batches_are_paced_by_the_speed() -> None:
    batches = [DueBatch(0.1, b"a"), DueBatch(0.3, b"b"), DueBatch(0.4, b"c")]

    async def took(speed: float) -> float:
        began = time.monotonic()
        assert [one async for one in pace_batches(batches, speed)] == [b"a", b"b", b"c"]
        return time.monotonic() - began

    assert 0.2 <= asyncio.run(took(2.0)) < 0.4
    assert asyncio.run(took(0.0)) < 0.1
