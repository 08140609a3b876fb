"""Hours to days of one sensor on the chest, block by block, with ground truth (docs/science/simulation.md,
"Daily life").

Transitions and walking are those of core/simulate/chest.py; during a held posture the sensor measures
gravity, breathing and occasional shifts in the seat. Random values of an item depend only on the seed and the
item's number, so that a day can be iterated any number of times.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import radians
from types import MappingProxyType
from typing import Final

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.formats.draft import signal_digest
from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.rotation import about, conjugate, multiply, rotate
from sagittal.core.signals.recording import ImuStream, Recording, Subject
from sagittal.core.signals.sample_blocks import LongStream, SampleBlock
from sagittal.core.simulate.chest import (
    POSTURES,
    STEPPING,
    ChestStyle,
    Posture,
    PostureHold,
    simulate_day,
)
from sagittal.core.simulate.gait.stance import Q_NEUTRAL
from sagittal.core.simulate.phases import Phase
from sagittal.core.simulate.scripts import ON_SKIN
from sagittal.core.simulate.sensors import Mount, draw_mounts
from sagittal.core.simulate.walker import Walker

NOISE: Final = 0.03
"""White noise of the accelerometer, m/s²: that of wearables which record for days [our choice]."""

GYRO_NOISE: Final = 0.003
BREATH_HZ: Final = 0.25
BREATH_RAD: Final = (radians(0.5), radians(1.5))
"""Breathing tilts the chest by as much [our choice]."""

SHIFT_EVERY_S: Final = 240.0
"""Mean time between shifts in the seat, on the legs or in bed [our choice]."""

SHIFT_RAD: Final = radians(5.0)

OFF: Final = "off"
"""The sensor lies on a table."""

HABITS: Final[Mapping[str, float]] = MappingProxyType(
    {"sit": 0.38, "chores": 0.3, "walk": 0.2, "stairs": 0.06, "rest": 0.05, "off": 0.01}
)
"""What comes next in a day, with its probability [our choice]."""

ITEM_S: Final = 600.0
"""Longest block of a held posture."""

KIND_OF: Final[Mapping[str, str]] = MappingProxyType(
    {
        "stand": "standing",
        "bow": "standing",
        "sit": "sitting",
        "lie": "lying",
        "lie_side": "lying",
        "walk": "walking",
        "stairs_up": "stairs_up",
        "stairs_down": "stairs_down",
        OFF: "non_wear",
    }
)
"""What is done → what the monitor calls it."""


@dataclass(frozen=True)
class DailyItem:
    """A part of a day: a posture held, a walk, a bow, or the sensor taken off (`OFF`)."""

    posture: Posture | str
    duration_s: float
    steps_per_min: float = 110.0


@dataclass(frozen=True, eq=False)
class DailySimulation:
    """A long recording with its ground truth.

    Parameters
    ----------
    phases : activities, including transitions ("sit_to_stand" …). steps_s : highest points of the steps.
    """

    stream: LongStream
    phases: tuple[Phase, ...]
    steps_s: Floats
    style: ChestStyle
    height_m: float
    mount: Mount


def plan_daily_life(hours: float, seed: int) -> tuple[DailyItem, ...]:
    """A day from midnight on: night, getting up, hours of sitting, standing and walking, one period of
    non-wear.

    Raises
    ------
    ParameterError : `hours_range`.
    """
    if not 0.1 <= hours <= 240.0:
        raise ParameterError("hours_range", f"{hours:g} hours of daily life; expected 0.1 to 240.")
    rng = np.random.default_rng(np.random.SeedSequence((seed, 7)))
    items: list[DailyItem] = [
        DailyItem("stand", 10.0),
        DailyItem("walk", 30.0, 100.0),
        DailyItem("sit", 20.0),
    ]
    end = hours * 3600.0

    def passed() -> float:
        return sum(i.duration_s for i in items)

    while passed() < end:
        day_left = 86400.0 - passed() % 86400.0
        if day_left > 79200.0 and hours > 10.0:
            items += _spend_night(rng)
        kind = rng.choice(
            ["sit", "chores", "walk", "stairs", "rest", "off"], p=[0.38, 0.3, 0.2, 0.06, 0.05, 0.01]
        )
        if kind != "off" or not any(i.posture == OFF for i in items):
            items += _spend_time(str(kind), rng)
    return tuple(items)


def _spend_night(rng: np.random.Generator) -> list[DailyItem]:
    """Lying alternately on the back and the sides, then getting up."""
    items: list[DailyItem] = []
    asleep = float(rng.uniform(6.0, 7.5)) * 3600.0
    while asleep > 0.0:
        part = float(rng.uniform(1200.0, 5400.0))
        items.append(DailyItem(str(rng.choice(["lie", "lie_side"])), part))
        asleep -= part
    return [*items, DailyItem("sit", 30.0)]


def _spend_time(kind: str, rng: np.random.Generator) -> list[DailyItem]:
    """Some minutes of a day: one of the activities drawn by `plan_daily_life`."""
    if kind == "sit":
        return [
            DailyItem("stand", 4.0),
            DailyItem("sit", float(rng.uniform(60.0, 2400.0))),
            DailyItem("stand", 5.0),
        ]
    if kind == "chores":
        return _do_chores(rng)
    if kind == "walk":
        pace = float(rng.uniform(90.0, 125.0))
        return [DailyItem("walk", float(rng.uniform(30.0, 600.0)), pace), DailyItem("stand", 8.0)]
    if kind == "stairs":
        pace = float(rng.uniform(80.0, 100.0))
        way = str(rng.choice(["stairs_up", "stairs_down"]))
        return [
            DailyItem("walk", 15.0, pace),
            DailyItem(way, float(rng.uniform(10.0, 30.0)), pace),
            DailyItem("walk", 12.0, pace),
        ]
    if kind == "rest":
        return [
            DailyItem("sit", 20.0),
            DailyItem("lie", float(rng.uniform(300.0, 2400.0))),
            DailyItem("sit", 15.0),
        ]
    return [
        DailyItem("stand", 20.0),
        DailyItem(OFF, float(rng.uniform(2400.0, 5400.0))),
        DailyItem("stand", 20.0),
    ]


def _do_chores(rng: np.random.Generator) -> list[DailyItem]:
    """Alternate standing and short walks, with occasional bowing."""
    items: list[DailyItem] = []
    for _ in range(int(rng.integers(1, 6))):
        pace = float(rng.uniform(80.0, 115.0))
        items += [DailyItem("stand", float(rng.uniform(5.0, 120.0)))]
        items += [DailyItem("walk", float(rng.uniform(6.0, 20.0)), pace)]
        if rng.random() < 0.3:
            items += [DailyItem("stand", 2.0), DailyItem("bow", float(rng.uniform(2.0, 4.0)))]
    return items


def draw_style(seed: int) -> ChestStyle:
    """Random style of a person: rising, lying down and sway."""
    rng = np.random.default_rng(np.random.SeedSequence((seed, 11)))
    return ChestStyle(
        lean_rad=float(rng.uniform(radians(25.0), radians(45.0))),
        change_s=float(rng.uniform(1.5, 3.0)),
        lying_s=float(rng.uniform(2.0, 4.0)),
        bow_rad=float(rng.uniform(radians(35.0), radians(65.0))),
        sway_m=0.02,
    )


def simulate_daily_life(
    items: tuple[DailyItem, ...],
    height_m: float = 1.75,
    seed: int = 0,
    rate_hz: float = 50.0,
    has_gyro: bool = False,
    style: ChestStyle | None = None,
) -> DailySimulation:
    """Simulate a person going through a plan with one sensor on the chest."""
    style = style or draw_style(seed)
    rng = np.random.default_rng(np.random.SeedSequence((seed, 13)))
    scale = Walker.of_height(height_m).scale
    mount = draw_mounts({"chest": (0.0, 0.0, 0.0)}, scale, float(np.pi), rng)["chest"]
    person = _Person(items, height_m, seed, rate_hz, has_gyro, style, mount)
    phases: list[Phase] = []
    steps: list[Floats] = []
    now = 0.0
    for i in range(len(items)):
        plan = person.outline(i)
        phases += [Phase(p.kind, p.start_s + now, p.end_s + now) for p in plan.phases]
        steps.append(plan.steps_s + now)
        now += plan.samples / rate_hz
    stream = LongStream(
        device_id=f"DAY{seed:05d}",
        source=f"daily_{seed}",
        rate_hz=rate_hz,
        has_gyro=has_gyro,
        duration_s=now - 1.0 / rate_hz,
        open_blocks=person.blocks,
    )
    return DailySimulation(stream, tuple(phases), np.concatenate(steps), style, height_m, mount)


def record_daily_life(simulation: DailySimulation) -> Recording:
    """The whole recording in memory, assigned to the chest."""
    blocks = list(simulation.stream.open_blocks())
    t_s, acc = (np.concatenate([getattr(b, name) for b in blocks]) for name in ("t_s", "acc"))
    gyr = [b.gyr for b in blocks if b.gyr is not None]
    rates = np.concatenate(gyr) if gyr else None
    stream = ImuStream(
        device_id=simulation.stream.device_id,
        source=simulation.stream.source,
        t_s=t_s,
        acc=acc,
        gyr=rates,
        mag=None,
        quat=None,
        rate_hz=simulation.stream.rate_hz,
        clock="device",
        digest=signal_digest(acc, rates, None),
    )
    subject = Subject(height_m=simulation.height_m)
    return Recording({stream.device_id: stream}, {stream.device_id: "chest"}, subject, "activity")


@dataclass(frozen=True, eq=False)
class _Outline:
    """Timing of an item: its transition and itself, and the number of samples."""

    phases: tuple[Phase, ...]
    steps_s: Floats
    samples: int
    moving: int


@dataclass(frozen=True, eq=False)
class _Person:
    """A person going through items."""

    items: tuple[DailyItem, ...]
    height_m: float
    seed: int
    rate_hz: float
    has_gyro: bool
    style: ChestStyle
    mount: Mount

    def outline(self, i: int) -> _Outline:
        """Times of item i, without its samples."""
        item, previous = self.items[i], self._before(i)
        takes = self._change_s(previous, item.posture)
        length = takes + item.duration_s
        samples = round(length * self.rate_hz)
        # the moving part is worked out, what is held after it is not
        moving = samples if item.posture in STEPPING or item.posture == "bow" else round(takes * self.rate_hz)
        phases = []
        if takes:
            phases.append(Phase(f"{_base(previous)}_to_{_base(item.posture)}", 0.0, takes))
        phases.append(Phase(item.posture, takes, samples / self.rate_hz))
        steps: Floats = np.empty(0)
        if item.posture in STEPPING:
            pace = item.steps_per_min / 60.0
            steps = np.asarray((np.arange(int(item.duration_s * pace)) + 0.25) / pace, np.float64)
        return _Outline(tuple(phases), steps, samples, moving)

    def blocks(self) -> Iterator[SampleBlock]:
        """Blocks of the recording from its first sample."""
        first = 0
        for i in range(len(self.items)):
            plan = self.outline(i)
            rng = np.random.default_rng(np.random.SeedSequence((self.seed, 17, i)))
            acc, gyr = self._move(i, plan) if plan.moving else (np.empty((0, 3)), np.empty((0, 3)))
            yield self._block(first, acc, gyr, rng)
            first += len(acc)
            left = plan.samples - len(acc)
            while left > 0:
                count = min(left, round(ITEM_S * self.rate_hz))
                yield self._block(first, *self._hold(self.items[i].posture, first, count, rng), rng)
                first, left = first + count, left - count

    def _before(self, i: int) -> str:
        """Initial posture of item i."""
        previous = next((x.posture for x in reversed(self.items[:i]) if x.posture != "bow"), None)
        return self.items[i].posture if previous is None else previous

    def _change_s(self, previous: str, posture: str) -> float:
        a, b = _base(previous), _base(posture)
        if a == b or OFF in (a, b):
            return 0.0
        return self.style.lying_s if "lie" in (a, b) else self.style.change_s

    def _move(self, i: int, outline: _Outline) -> tuple[Floats, Floats]:
        """Samples of the moving part of an item."""
        item, previous = self.items[i], _base(self._before(i))
        edge = 1.0
        day = [PostureHold(previous, edge)] if previous != OFF else []  # type: ignore[arg-type]
        if item.posture in STEPPING or item.posture == "bow":
            day.append(PostureHold(item.posture, item.duration_s, item.steps_per_min))  # type: ignore[arg-type]
        day.append(PostureHold(_base(item.posture), edge))  # type: ignore[arg-type]
        setup = replace(ON_SKIN, rate_hz=self.rate_hz, noise=None)
        simulated = simulate_day(tuple(day), self.height_m, self.seed, setup, self.style, self.mount)
        signals = simulated.ideal["chest"]
        start = round(edge * self.rate_hz)
        part = slice(start, start + outline.moving)
        return signals.acc[part], signals.gyr[part]

    def _hold(self, posture: str, first: int, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Samples of a held posture: gravity, breathing, and shifts of the trunk."""
        t = (first + np.arange(count)) / self.rate_hz
        if posture == OFF:
            flat = np.tile([0.0, 0.0, GRAVITY], (count, 1))
            return flat, np.zeros((count, 3))
        pitch: Floats = np.full(count, POSTURES[_base(posture)].pitch_rad)  # type: ignore[index]
        breath = np.random.default_rng((self.seed, 19)).uniform(*BREATH_RAD)
        pitch = np.asarray(pitch + breath * np.sin(2.0 * np.pi * BREATH_HZ * t))
        for shift_s in t[0] + np.cumsum(rng.exponential(SHIFT_EVERY_S, 40)):
            pitch = pitch + rng.normal(0.0, SHIFT_RAD) * np.exp(-(((t - shift_s) / 1.5) ** 2))
        roll = np.full(count, 0.5 * np.pi if posture == "lie_side" else 0.0)
        q = multiply(multiply(Q_NEUTRAL, about(2, -pitch)), about(1, roll))
        up = rotate(conjugate(multiply(q, self.mount.q_segment_sensor)), np.array([0.0, 0.0, GRAVITY]))
        return up, np.zeros((count, 3))

    def _block(self, first: int, acc: Floats, gyr: Floats, rng: np.random.Generator) -> SampleBlock:
        t = (first + np.arange(len(acc))) / self.rate_hz
        noisy = acc + rng.normal(0.0, NOISE, acc.shape)
        rate = gyr + rng.normal(0.0, GYRO_NOISE, gyr.shape) if self.has_gyro else None
        return SampleBlock(t, noisy, rate)


def _base(posture: str) -> str:
    """The posture at the other end of transitions."""
    if posture in STEPPING or posture == "bow":
        return "stand"
    return "lie" if posture == "lie_side" else posture
