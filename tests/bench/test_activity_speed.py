"""Daily life: time grows with the length of the recording, memory does not."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from core.activity.monitor import monitor_activity
from core.sample_blocks import LongStream, SampleBlock
from core.simulate.daily import plan_daily_life, simulate_daily_life
from tests.bench.pairs import cpu_s, in_pairs, plain_python

RATE = 100.0
HOUR = 3600.0


def repeat(stream: LongStream, blocks: list[SampleBlock], times: int) -> LongStream:
    """The same hours, one after the other."""
    length = float(blocks[-1].t_s[-1]) + 1.0 / RATE

    def open_blocks() -> Iterator[SampleBlock]:
        for k in range(times):
            for b in blocks:
                yield SampleBlock(b.t_s + k * length, b.acc, b.gyr)

    return replace(stream, duration_s=times * length, open_blocks=open_blocks)


@pytest.fixture(scope="module")
def day() -> tuple[LongStream, list[SampleBlock]]:
    made = simulate_daily_life(plan_daily_life(2.0, 4), 1.7, 4, RATE)
    blocks = list(made.stream.open_blocks())
    monitor_activity(repeat(made.stream, blocks[:20], 1), "chest", 1.7)
    return made.stream, blocks


@pytest.mark.bench
def test_an_hour_costs_some_ten_times_a_fixed_piece_of_work(
    day: tuple[LongStream, list[SampleBlock]],
) -> None:
    hours = day[0].duration_s / HOUR
    ours, yardstick, ratio = in_pairs(
        lambda: monitor_activity(repeat(*day, 1), "chest", 1.7), plain_python, 3
    )
    sys.stdout.write(
        f"\ndaily life: {ours / hours:.2f} s of CPU an hour awake at 100 Hz, {ratio / hours:.1f} times "
        f"plain Python's {1e3 * yardstick:.0f} ms\n"
    )
    # a third of a day is slept, which costs a third of that
    assert ratio / hours <= 11.0


@pytest.mark.bench
def test_three_times_as_long_costs_three_times_as_much(day: tuple[LongStream, list[SampleBlock]]) -> None:
    once = min(cpu_s(lambda: monitor_activity(repeat(*day, 1), "chest", 1.7)) for _ in range(2))
    thrice = cpu_s(lambda: monitor_activity(repeat(*day, 3), "chest", 1.7))
    sys.stdout.write(f"\nthree times as long: {thrice / once:.2f} times the CPU\n")
    assert thrice <= 3.6 * once


MEMORY = """
import resource, sys
import numpy as np
from core.activity.monitor import monitor_activity
from core.sample_blocks import LongStream, SampleBlock
hours = float(sys.argv[1])
rng = np.random.default_rng(0)
def blocks():
    for k in range(int(hours * 6)):
        t = 600.0 * k + np.arange(30000) / 50.0
        acc = rng.normal(0.0, 0.05, (30000, 3)) + [0.0, 0.0, 9.81]
        acc[:, 0] += 0.1 * np.sin(2 * np.pi * 0.25 * t)
        yield SampleBlock(t, acc, None)
monitor_activity(LongStream("A", "a", 50.0, False, hours * 3600.0, blocks), "chest", 1.7)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
"""


@pytest.mark.bench
def test_two_days_need_hardly_more_memory_than_one() -> None:
    one, two = (
        float(subprocess.check_output([sys.executable, "-c", MEMORY, hours], text=True))
        for hours in ("27", "51")
    )
    sys.stdout.write(f"\nmemory: {one:.0f} MB for 27 h, {two:.0f} MB for 51 h\n")
    # measured 1.12: a day keeps some 40 MB, which is not yet what it should be, nothing
    assert two <= 1.2 * one
    assert np.isfinite(one)
