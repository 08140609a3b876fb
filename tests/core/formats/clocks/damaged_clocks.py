"""Clocks of a logger with known faults: stamps as a file has them, and the true sample of every row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Floats

Ints = NDArray[np.int64]


@dataclass
class DamagedClock:
    """Rows as written.

    Parameters
    ----------
    stamps : (n,) of every row. sample : (n,) number of the sample that the row is. step : true interval.
    seconds : whether stamps are in s, else counts. causes : codes that should be reported.
    packet : rows whose order in time nothing tells.
    """

    stamps: Floats
    sample: Ints
    step: float
    seconds: bool = True
    causes: set[str] = field(default_factory=set)
    wrap: float | None = None
    tick: float = 0.0
    packet: int = 1
    restart: bool = False
    constant: bool = False

    @property
    def rows(self) -> int:
        return len(self.stamps)


def make_clock(rng: np.random.Generator) -> DamagedClock:
    """A clean clock of 15 to 60 s at a rate of a real logger, counting from anywhere."""
    rate = float(rng.choice([50, 60, 99.7, 100, 100.2, 104, 120, 128, 148.15, 200, 204.8, 256, 400]))
    n = int(rate * rng.uniform(15, 60))
    start = float(rng.choice([0.0, 0.37, 133.5, 7174.0, 1.7e9]))
    return DamagedClock(start + np.arange(n) / rate, np.arange(n, dtype=np.int64), 1.0 / rate)


def _take(clock: DamagedClock, rows: Ints) -> None:
    clock.stamps, clock.sample = clock.stamps[rows], clock.sample[rows]


def _somewhere(clock: DamagedClock, rng: np.random.Generator, margin: int = 200) -> int:
    return int(rng.integers(margin, clock.rows - margin))


def share_packets(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Rows of a packet share the stamp of its first."""
    size = int(rng.choice([2, 3, 4, 5, 8, 12, 16, 25, 32]))
    clock.stamps, clock.packet = clock.stamps[(np.arange(clock.rows) // size) * size], size
    clock.causes.add("stamps_shared")


def share_jittered_packets(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Packets are stamped on arrival, late by up to 0.8 of a sample."""
    size = int(rng.choice([3, 4, 5, 8, 12]))
    late = rng.uniform(0, 0.8 * clock.step, clock.rows)
    clock.stamps = (clock.stamps + late)[(np.arange(clock.rows) // size) * size]
    clock.causes.add("stamps_shared")


def burst(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Rows of a packet are stamped one after the other as they are unpacked."""
    size = int(rng.choice([4, 5, 8, 12, 16]))
    n = np.arange(clock.rows)
    clock.stamps = clock.stamps[(n // size) * size] + (n % size) * 2e-5
    clock.causes.add("stamps_shared")


def cut_decimals(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Stamps without decimals, or with one."""
    unit = float(rng.choice([1.0, 0.1]))
    clock.stamps = np.floor(clock.stamps / unit + 1e-6) * unit
    clock.causes.add("stamps_shared")


def one_leaps(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Single stamps are far off, also the first or the last."""
    rows = rng.choice(clock.rows, int(rng.integers(1, 8)), replace=False)
    off = rng.choice([-1, 1], len(rows)) * rng.uniform(0.3, 2000.0, len(rows))
    clock.stamps = clock.stamps.copy()
    clock.stamps[rows] += off
    clock.causes.add("stamps_wrong")


def zeros(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Single stamps are 0."""
    clock.stamps = clock.stamps.copy() + 10.0
    clock.stamps[rng.choice(clock.rows, int(rng.integers(1, 6)), replace=False)] = 0.0
    clock.causes.add("stamps_wrong")


def packet_end_leaps(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Towards the end one stamp in eight is the time of the read-out."""
    every = int(rng.choice([4, 8, 10]))
    count = int(rng.integers(4, 40))
    rows = clock.rows - 1 - every * np.arange(1, count + 1)
    clock.stamps = clock.stamps.copy()
    clock.stamps[rows] += float(rng.uniform(0.2, 1.5))
    clock.causes.add("stamps_wrong")


def all_leap(clock: DamagedClock, rng: np.random.Generator) -> None:
    """All later stamps leap by an amount that explains itself."""
    at = _somewhere(clock, rng)
    by = float(rng.choice([512.0, 3600.0, -3600.0, 7200.0, 1800.0, 86400.0, 1024.0]))
    clock.stamps = clock.stamps + by * (np.arange(clock.rows) >= at)
    clock.causes.add("clock_leap")
    if by < 0:
        clock.stamps += 7200.0


def swap_packets(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Packets come late by one or two others."""
    a, b = int(rng.integers(1, 7)), int(rng.integers(1, 7))
    rows = np.arange(clock.rows)
    for at in rng.choice(np.arange(20, clock.rows - 40, 30), int(rng.integers(3, 12)), replace=False):
        part = rows[at : at + a + b].copy()
        rows[at : at + a + b] = np.concatenate((part[a:], part[:a]))
    _take(clock, rows)
    clock.causes.add("out_of_order")


def send_twice(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Packets are stored twice, the second time somewhat later."""
    size, later = int(rng.integers(1, 10)), int(rng.integers(0, 30))
    parts, at = [], 0
    starts = sorted(rng.choice(np.arange(20, clock.rows - 100, 60), int(rng.integers(3, 12)), replace=False))
    for start in starts:
        parts += [np.arange(at, start + size + later), np.arange(start, start + size)]
        at = start + size + later
    parts.append(np.arange(at, clock.rows))
    _take(clock, np.concatenate(parts))
    clock.causes.add("rows_repeated")


def lose(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Samples are missing, some or many at once."""
    keep = np.ones(clock.rows, np.bool_)
    for at in rng.choice(np.arange(20, clock.rows - 420, 20), int(rng.integers(2, 10)), replace=False):
        keep[at : at + int(rng.choice([1, 2, 5, 20, 150, 400]))] = False
    _take(clock, np.flatnonzero(keep))


def repeat_stamps(clock: DamagedClock, rng: np.random.Generator) -> None:
    """A few stamps repeat the one before although the sample is new."""
    rows = rng.choice(np.arange(10, clock.rows - 10, 7), clock.rows // 90, replace=False)
    clock.stamps = clock.stamps.copy()
    clock.stamps[rows] = clock.stamps[rows - 1]
    clock.causes.add("stamps_shared")


def blank(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Cells without a time."""
    clock.stamps = clock.stamps.copy()
    at = _somewhere(clock, rng)
    clock.stamps[at : at + int(rng.integers(1, 12))] = np.nan
    clock.stamps[rng.choice(clock.rows, int(rng.integers(1, 20)), replace=False)] = np.nan
    clock.causes.add("stamps_missing")


def midnight(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Seconds of the day, of the half day, of the hour."""
    range_s = float(rng.choice([86400.0, 43200.0, 3600.0]))
    span = clock.sample[-1] * clock.step
    start = range_s - span * rng.uniform(0.2, 0.8)
    clock.stamps = np.mod(start + clock.sample * clock.step, range_s)
    clock.causes.add("clock_wrapped")


def wrap_ticks(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Ticks of 16, 24 or 32 bits, of any length."""
    bits = int(rng.choice([16, 24, 32]))
    tick = {16: 1e-3, 24: 1 / 32768, 32: 1e-6}[bits]
    range_s = 2.0**bits * tick
    span = clock.rows * clock.step
    start = range_s - min(span, 0.9 * range_s) * rng.uniform(0.2, 0.8)
    ticks = np.round((start + clock.sample * clock.step) / tick)
    clock.stamps, clock.tick = np.mod(ticks, 2.0**bits) * tick, tick
    clock.causes.add("clock_wrapped")


def count(clock: DamagedClock, rng: np.random.Generator) -> None:
    """A counter of 8 to 16 bits, with losses shorter than half of it."""
    clock.wrap = float(rng.choice([256, 1024, 4096, 65536]))
    keep = np.ones(clock.rows, np.bool_)
    most = int(min(clock.wrap / 2 - 2, 300))
    for at in rng.choice(np.arange(20, clock.rows - 320, 320), 2, replace=False):
        keep[at : at + int(rng.integers(1, most))] = False
    clock.stamps = np.mod(np.arange(clock.rows) + int(rng.integers(0, 256)), clock.wrap).astype(float)
    clock.seconds, clock.step = False, 1.0
    _take(clock, np.flatnonzero(keep))


def start_again(clock: DamagedClock, rng: np.random.Generator) -> None:
    """Two recordings one after the other."""
    at = _somewhere(clock, rng, 300)
    clock.stamps = np.concatenate((clock.stamps[:at], clock.stamps[: clock.rows - at]))
    clock.restart = True


def round_all(clock: DamagedClock, rng: np.random.Generator) -> None:
    """A spreadsheet leaves five digits of microseconds since 1970."""
    clock.stamps = np.full(clock.rows, 1.7e9)
    clock.constant = True


def delay(clock: DamagedClock, rng: np.random.Generator) -> None:
    """A radio pauses and catches up: rows bear the time of arrival."""
    clock.stamps = clock.stamps.copy()
    for at in rng.choice(np.arange(50, clock.rows - 100, 60), int(rng.integers(2, 8)), replace=False):
        size = int(rng.integers(5, 25))
        until = clock.stamps[at + size]
        clock.stamps[at : at + size] = until - (size - np.arange(size)) * 0.05 * clock.step
    clock.causes.add("stamps_late")


FAULTS: dict[str, Callable[[DamagedClock, np.random.Generator], None]] = {
    f.__name__: f
    for f in (
        share_packets, share_jittered_packets, burst, cut_decimals, one_leaps, zeros, packet_end_leaps,
        all_leap, swap_packets, send_twice, lose, repeat_stamps, blank, midnight, wrap_ticks, count,
        start_again, round_all, delay,
    )
}  # fmt: skip
"""Faults by name."""

PAIRS = [
    ("swap_packets", "send_twice"), ("lose", "swap_packets"), ("one_leaps", "lose"),
    ("all_leap", "one_leaps"), ("blank", "all_leap"), ("midnight", "one_leaps"), ("share_packets", "lose"),
    ("send_twice", "all_leap"), ("blank", "swap_packets"), ("lose", "midnight"),
    ("repeat_stamps", "one_leaps"), ("share_packets", "all_leap"), ("share_packets", "blank"),
    ("lose", "all_leap"),
]  # fmt: skip
"""Faults that are also tried together."""


def damage(names: tuple[str, ...], seed: int) -> DamagedClock:
    """A clock with the faults of these names."""
    rng = np.random.default_rng(seed)
    clock = make_clock(rng)
    for name in names:
        FAULTS[name](clock, rng)
    return clock
