"""One time for the streams of a live take: the least delayed batch of the first second decides."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.formats.live_clock import SETTLING_US, LiveClock, sample_times_us
from sagittal.core.formats.live_hello import Clock, Hello, SensorInfo, StreamInfo
from sagittal.core.formats.live_log import SampleBatch


def hello(*clocks: Clock) -> Hello:
    sensors = (SensorInfo("A", "foot_l"),)
    return Hello("take", "sdk", tuple(StreamInfo(i, 100.0, c, sensors) for i, c in enumerate(clocks)))  # type: ignore[arg-type]


def batch(samples: int, t0_us: int = 1000, offsets: list[int] | None = None) -> SampleBatch:
    given = None if offsets is None else np.array(offsets, np.uint32)
    return SampleBatch(0, 0, t0_us, 0, np.zeros((samples, 1, 9), np.float32), given)


def test_samples_are_at_their_offsets_else_evenly_by_the_rate() -> None:
    assert sample_times_us(batch(3, 7, [0, 9, 21]), 100.0).tolist() == [7, 16, 28]
    assert sample_times_us(batch(4), 60.0).tolist() == [1000, 17667, 34333, 51000]
    long = sample_times_us(batch(2, offsets=[0, 2**32 - 1]), 100.0)
    assert long.tolist() == [1000, 1000 + 2**32 - 1]


def test_times_of_one_batch_do_not_reach_the_next() -> None:
    first = sample_times_us(batch(3), 100.0)
    first += 5
    assert sample_times_us(batch(3), 100.0).tolist() == [1000, 11000, 21000]


@pytest.mark.parametrize(
    ("clocks", "single"),
    [(("own",), True), (("shared", "shared"), True), (("shared", "own"), False), (("own", "own"), False)],
)
def test_with_one_clock_there_is_nothing_to_align(clocks: tuple[Clock, ...], single: bool) -> None:
    clock = LiveClock(hello(*clocks))
    assert clock.single == single
    assert clock.offset_us(0) == (0 if single else None)
    clock.push(0, 0, 0, 500)
    assert clock.sender_offset_us(0) is None
    assert clock.sender_offset_us(0, final=False) == 500


def test_the_smallest_delay_of_the_first_second_is_taken_and_stays() -> None:
    clock = LiveClock(hello("own", "own"))
    clock.push(0, 0, 100_000, 150_000)
    clock.push(0, 100_000, 500_000, 530_000)
    clock.push(0, 500_000, 900_000, 990_000)
    assert clock.offset_us(0) is None
    assert clock.offset_us(0, final=False) == 30_000
    clock.push(0, 900_000, SETTLING_US, SETTLING_US + 20_000)
    assert clock.offset_us(0) == 20_000
    clock.push(0, SETTLING_US, SETTLING_US + 1, SETTLING_US + 2)
    assert clock.offset_us(0) == 20_000
    assert clock.offset_us(1, final=False) is None


def test_a_batch_that_ends_after_the_first_second_only_ends_it() -> None:
    clock = LiveClock(hello("own", "own"))
    clock.push(1, 10_000, 400_000, 450_000)
    clock.push(1, 400_000, SETTLING_US + 10_001, SETTLING_US + 10_002)
    assert clock.offset_us(1) == 50_000
    long = LiveClock(hello("own", "own"))
    long.push(0, 0, 2 * SETTLING_US, 2 * SETTLING_US + 70_000)
    assert long.offset_us(0) == 70_000, "one batch is longer than the second"


def test_streams_of_the_shared_clock_have_one_offset() -> None:
    clock = LiveClock(hello("shared", "own", "shared"))
    clock.push(0, 0, 600_000, 640_000)
    clock.push(2, 0, 1_000_000, 1_010_000)
    assert clock.offset_us(0) == clock.offset_us(2) == 10_000
    assert clock.offset_us(1) is None
