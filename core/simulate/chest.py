"""A sensor on the breastbone while a person sits, stands, lies and walks
(docs/science/simulation.md, "Chest").

For the recognition of postures and of rising from a chair. It moves in one plane: no rolling over in bed, no
turning, no stairs; it has not been compared with recordings of a chest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from types import MappingProxyType
from typing import Final, Literal

import numpy as np

from core.errors import ParameterError
from core.frames import Floats
from core.rotation import about, multiply, rotate
from core.simulate.phases import Phase
from core.simulate.recorder import Draws, Recorded, oversampling, record
from core.simulate.sensors import Mount, SensorPath, draw_mounts
from core.simulate.setup import RecordingSetup
from core.simulate.shapes import bump, smoothstep
from core.simulate.spline import sign_continuous
from core.simulate.stance import Q_NEUTRAL
from core.simulate.walker import Walker

Posture = Literal["stand", "sit", "lie", "walk"]


@dataclass(frozen=True)
class HeldPosture:
    """A posture of the reference person: height of the breastbone in m, trunk pitch (forward positive)."""

    height_m: float
    pitch_rad: float


POSTURES: Final[Mapping[Posture, HeldPosture]] = MappingProxyType(
    {
        "stand": HeldPosture(1.30, radians(3.0)),
        "walk": HeldPosture(1.30, radians(3.0)),
        "sit": HeldPosture(0.90, radians(8.0)),
        "lie": HeldPosture(0.65, radians(-88.0)),
    }
)

CHANGE_S: Final = 1.5
"""Duration of rising and sitting down; healthy people take 1.5 ± 0.3 s
(docs/science/simulation.md, "Chest")."""

LYING_S: Final = 3.0
"""Duration of lying down and getting up."""

LEAN: Final = radians(35.0)
"""The trunk leans forward by so much on the way up from a chair, and down to it."""

LIFTING: Final = 0.7
"""Share of the change in which the height changes: its last part going up, its first going down."""

FORWARD_M: Final = 0.25
"""Breastbone forward over the feet when rising."""

WALKING_MPS: Final = 1.1
BOUNCE_M, SURGE_M, NOD = 0.02, 0.01, radians(1.5)
"""Rise and fall, forward and back, and pitch with each step."""

STARTING_S: Final = 0.8
"""Walking begins and ends over so long."""


@dataclass(frozen=True)
class PostureHold:
    """Stay in a posture; `steps_per_min` counts for walking."""

    posture: Posture
    duration_s: float
    steps_per_min: float = 110.0


Day = tuple[PostureHold, ...]


@dataclass(frozen=True, eq=False)
class ChestTruth:
    """Exact truth at the samples of the recording.

    Parameters
    ----------
    t_s : (n,). pitch_rad : (n,) of the trunk, forward positive. height_m, forward_m : (n,) of the breastbone.
    phases : postures and the changes between them ("sit_to_stand" …) over the whole take.
    steps_s : when each step of the walking has its highest point.
    """

    t_s: Floats
    rate_hz: float
    pitch_rad: Floats
    height_m: Floats
    forward_m: Floats
    phases: tuple[Phase, ...]
    steps_s: Floats
    mount: Mount


@dataclass(frozen=True, eq=False)
class ChestSimulation(Recorded):
    """A recording of one sensor on the chest and what really happened."""

    truth: ChestTruth


def simulate_day(
    day: Day, height_m: float = 1.75, seed: int = 0, setup: RecordingSetup | None = None
) -> ChestSimulation:
    """Let a person of a height go through postures with one sensor on the chest.

    Raises
    ------
    ParameterError : "day_item", "height_implausible".
    """
    _check(day)
    setup, draws, scale = setup or RecordingSetup(), Draws(seed), Walker.of_height(height_m).scale
    every = oversampling(setup.rate_hz)
    phases = _phases(day)
    t = np.arange(round(phases[-1].end_s * every * setup.rate_hz) + 1) / (every * setup.rate_hz)
    height, pitch, forward, steps = _way(t, day, phases)
    height, forward = scale * height, scale * forward

    mount = draw_mounts({"chest": (0.0, 0.0, 0.0)}, scale, setup.mount_spread_rad, draws.mounts)["chest"]
    q = multiply(Q_NEUTRAL, about(2, -pitch))
    way = np.stack((forward, np.zeros(len(t)), height), axis=-1) + rotate(q, mount.position_m)
    path = SensorPath(t, way, sign_continuous(multiply(q, mount.q_segment_sensor)))
    made = record({"chest": path}, setup, draws, height_m, protocol="activity")
    truth = ChestTruth(
        t[::every], setup.rate_hz, pitch[::every], height[::every], forward[::every], phases, steps, mount
    )
    return ChestSimulation(**vars(made), truth=truth)


def _phases(day: Day) -> tuple[Phase, ...]:
    """Postures and the changes between them; from standing one simply walks off."""
    phases: list[Phase] = []
    now, before = 0.0, day[0].posture
    for hold in day:
        if {before, hold.posture} not in ({before}, {"stand", "walk"}):
            takes = LYING_S if "lie" in (before, hold.posture) else CHANGE_S
            phases.append(Phase(f"{_upright(before)}_to_{_upright(hold.posture)}", now, now + takes))
            now += takes
        phases.append(Phase(hold.posture, now, now + hold.duration_s))
        now, before = now + hold.duration_s, hold.posture
    return tuple(phases)


def _upright(posture: Posture) -> str:
    return "stand" if posture == "walk" else posture


def _way(t: Floats, day: Day, phases: tuple[Phase, ...]) -> tuple[Floats, Floats, Floats, Floats]:
    """Height and pitch (n,), way forward (n,) of the reference person, and times of the steps."""
    start = POSTURES[day[0].posture]
    height, pitch, forward = (
        np.full(len(t), start.height_m),
        np.full(len(t), start.pitch_rad),
        np.zeros(len(t)),
    )
    walks = iter([hold for hold in day if hold.posture == "walk"])
    steps: list[Floats] = []
    for phase in phases:
        u = (t - phase.start_s) / (phase.end_s - phase.start_s)
        if phase.kind == "walk":
            pace = next(walks).steps_per_min / 60.0
            steps.append(_walk(t, phase, pace, height, pitch, forward))
        elif "_to_" in phase.kind:
            a, b = (POSTURES[name] for name in phase.kind.split("_to_"))  # type: ignore[index]
            rises = b.height_m > a.height_m
            lifted = smoothstep((u - 1.0 + LIFTING) / LIFTING) if rises else smoothstep(u / LIFTING)
            height += (b.height_m - a.height_m) * lifted
            pitch += (b.pitch_rad - a.pitch_rad) * smoothstep(u)
            if "lie" not in phase.kind:
                pitch += LEAN * bump(u)
                forward += (FORWARD_M if rises else -FORWARD_M) * smoothstep(u)
    return height, pitch, forward, np.concatenate(steps) if steps else np.empty(0)


def _walk(t: Floats, phase: Phase, pace_hz: float, height: Floats, pitch: Floats, forward: Floats) -> Floats:
    """Add one walk in place; returns when its steps have their highest points."""
    into, left = t - phase.start_s, phase.end_s - t
    going = smoothstep(into / STARTING_S) * smoothstep(left / STARTING_S)
    wave = 2.0 * np.pi * pace_hz * into
    height += BOUNCE_M * going * np.sin(wave)
    pitch += NOD * going * np.sin(wave)
    step = t[1] - t[0]
    speed = np.concatenate(([0.0], 0.5 * (going[1:] + going[:-1])))
    forward += WALKING_MPS * np.cumsum(speed) * step + SURGE_M * going * np.sin(wave + 1.0)
    count = int((phase.end_s - phase.start_s) * pace_hz)
    return np.asarray(phase.start_s + (np.arange(count) + 0.25) / pace_hz)


def _check(day: Day) -> None:
    if not day:
        raise ParameterError("day_item", "A day has no postures; give at least one, e.g. Hold('sit', 5).")
    for i, hold in enumerate(day):
        if hold.posture not in POSTURES:
            raise ParameterError(
                "day_item", f"Item {i}: posture '{hold.posture}'; expected one of {', '.join(POSTURES)}."
            )
        shortest = 2.0 * STARTING_S if hold.posture == "walk" else 0.0
        if not (np.isfinite(hold.duration_s) and hold.duration_s > shortest):
            raise ParameterError(
                "day_item",
                f"Item {i} ({hold.posture}) lasts {hold.duration_s:g} s; expected above {shortest:g} s.",
            )
        if not 30.0 <= hold.steps_per_min <= 240.0:
            raise ParameterError(
                "day_item", f"Item {i}: {hold.steps_per_min:g} steps per minute; expected 30 to 240."
            )
