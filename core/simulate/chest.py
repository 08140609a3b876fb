"""A sensor on the sternum of a person who sits, stands, lies and walks (docs/science/simulation.md, "Chest").

For testing the recognition of postures and sit-to-stand transitions. Movement is in one plane except for
lying on a side, without turns, and has not been compared with chest recordings. Stairs are level walking with
the trunk lean and variability of published values (docs/science/activity.md, "Stairs").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from types import MappingProxyType
from typing import Final, Literal

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats
from sagittal.core.rotation import about, multiply, rotate
from sagittal.core.simulate.gait.chair import LEAN, LIFTING
from sagittal.core.simulate.gait.stance import Q_NEUTRAL
from sagittal.core.simulate.phases import Phase
from sagittal.core.simulate.recorder import Draws, Recorded, oversampling, record
from sagittal.core.simulate.sensors import Mount, SensorPath, draw_mounts
from sagittal.core.simulate.setup import RecordingSetup
from sagittal.core.simulate.shapes import bump, smoothstep
from sagittal.core.simulate.spline import sign_continuous
from sagittal.core.simulate.walker import Walker

Posture = Literal["stand", "sit", "lie", "walk", "lie_side", "stairs_up", "stairs_down", "bow"]


@dataclass(frozen=True)
class HeldPosture:
    """A posture of the reference person: height of the sternum in m, trunk pitch (forward positive)."""

    height_m: float
    pitch_rad: float


POSTURES: Final[Mapping[Posture, HeldPosture]] = MappingProxyType(
    {
        "stand": HeldPosture(1.30, radians(3.0)),
        "walk": HeldPosture(1.30, radians(3.0)),
        "sit": HeldPosture(0.90, radians(8.0)),
        "lie": HeldPosture(0.65, radians(-88.0)),
        "lie_side": HeldPosture(0.65, radians(-88.0)),
        "stairs_up": HeldPosture(1.30, radians(3.0)),
        "stairs_down": HeldPosture(1.30, radians(3.0)),
        "bow": HeldPosture(1.30, radians(3.0)),
    }
)

STEPPING: Final[Mapping[Posture, tuple[float, float]]] = MappingProxyType(
    {
        "walk": (0.0, 0.0),
        "stairs_up": (radians(12.0), radians(4.5)),
        "stairs_down": (radians(0.2), radians(3.5)),
    }
)
"""What is walked → how much further the trunk leans forward, and how far it rocks at `ROCKING_HZ`."""

ROCKING_HZ: Final = 0.35

ROLL_S: Final = 2.0
"""Duration of turning over in bed."""

TRUNK_M: Final = 0.45
"""From the hip to the breastbone: so far from the hinge it sinks when somebody bows."""

CHANGE_S: Final = 1.5
"""Duration of rising and sitting down; healthy people take 1.5 ± 0.3 s
(docs/science/simulation.md, "Chest")."""

LYING_S: Final = 3.0
"""Duration of lying down and getting up."""

FORWARD_M: Final = 0.25
"""Breastbone forward over the feet when rising."""

WALKING_MPS: Final = 1.1
BOUNCE_M, SURGE_M, NOD = 0.02, 0.01, radians(1.5)
"""Rise and fall, forward and back, and pitch with each step."""

STARTING_S: Final = 0.8
"""Walking begins and ends over so long."""


@dataclass(frozen=True)
class ChestStyle:
    """Movement style of a person; the defaults are a healthy adult without breathing.

    Parameters
    ----------
    lean_rad : forward lean in rising from a chair and sitting down. change_s : duration of these. lying_s :
        duration of lying down and getting up. bow_rad : of a bow. sway_m : lateral, with each stride.
    """

    lean_rad: float = LEAN
    change_s: float = CHANGE_S
    lying_s: float = LYING_S
    bow_rad: float = radians(55.0)
    sway_m: float = 0.0


@dataclass(frozen=True)
class PostureHold:
    """A posture held, a walk, or a bow for a duration; `steps_per_min` applies to walking and stairs."""

    posture: Posture
    duration_s: float
    steps_per_min: float = 110.0


Day = tuple[PostureHold, ...]


@dataclass(frozen=True, eq=False)
class ChestTruth:
    """Exact ground truth at the samples of the recording.

    Parameters
    ----------
    t_s : (n,). pitch_rad : (n,) of the trunk, forward positive. height_m, forward_m : (n,) of the sternum.
        phases : postures and the transitions between them ("sit_to_stand" …) over the whole recording.
        steps_s : time of the highest point of each step.
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
    """A recording of one sensor on the chest with its ground truth."""

    truth: ChestTruth


def simulate_day(
    day: Day,
    height_m: float = 1.75,
    seed: int = 0,
    setup: RecordingSetup | None = None,
    style: ChestStyle | None = None,
    mount: Mount | None = None,
) -> ChestSimulation:
    """Simulate a person of a height going through postures with one sensor on the chest.

    Parameters
    ----------
    mount : position and orientation of the sensor, None = random.

    Raises
    ------
    ParameterError : "day_item", "height_implausible".
    """
    _check(day)
    style = style or ChestStyle()
    setup, draws, scale = setup or RecordingSetup(), Draws(seed), Walker.of_height(height_m).scale
    every = oversampling(setup.rate_hz)
    phases = _phases(day, style)
    t = np.arange(round(phases[-1].end_s * every * setup.rate_hz) + 1) / (every * setup.rate_hz)
    height, pitch, forward, steps = _way(t, day, phases, style)
    height, forward = scale * height, scale * forward

    drawn = draw_mounts({"chest": (0.0, 0.0, 0.0)}, scale, setup.mount_spread_rad, draws.mounts)["chest"]
    mount = mount or drawn
    q = multiply(Q_NEUTRAL, about(2, -pitch))
    if any(p.kind == "lie_side" for p in phases):
        q = multiply(q, about(1, _roll(t, phases)))
    aside = _sway(t, day, phases, style.sway_m) if style.sway_m else np.zeros(len(t))
    way = np.stack((forward, aside, height), axis=-1) + rotate(q, mount.position_m)
    path = SensorPath(t, way, sign_continuous(multiply(q, mount.q_segment_sensor)))
    recorded = record({"chest": path}, setup, draws, height_m, protocol="activity")
    truth = ChestTruth(
        t[::every], setup.rate_hz, pitch[::every], height[::every], forward[::every], phases, steps, mount
    )
    return ChestSimulation(**vars(recorded), truth=truth)


def _phases(day: Day, style: ChestStyle) -> tuple[Phase, ...]:
    """Postures and the transitions between them; walking starts directly from standing."""
    phases: list[Phase] = []
    now, previous = 0.0, day[0].posture
    for hold in day:
        if _upright(previous) != _upright(hold.posture):
            takes = style.lying_s if "lie" in (_upright(previous), _upright(hold.posture)) else style.change_s
            phases.append(Phase(f"{_upright(previous)}_to_{_upright(hold.posture)}", now, now + takes))
            now += takes
        phases.append(Phase(hold.posture, now, now + hold.duration_s))
        # after a bow one is as one was
        now, previous = now + hold.duration_s, previous if hold.posture == "bow" else hold.posture
    return tuple(phases)


def _upright(posture: Posture) -> Posture:
    """The upright posture at the other end of a transition."""
    return "stand" if posture in STEPPING or posture == "bow" else "lie" if posture == "lie_side" else posture


def _roll(t: Floats, phases: tuple[Phase, ...]) -> Floats:
    """Rotation (n,) about the long axis of the trunk, rad, for lying on a side and turning back."""
    roll = np.zeros(len(t))
    for phase in phases:
        if phase.kind == "lie_side":
            into, left = (t - phase.start_s) / ROLL_S, (phase.end_s - t) / ROLL_S
            roll += 0.5 * np.pi * smoothstep(into) * smoothstep(left)
    return roll


def _sway(t: Floats, day: Day, phases: tuple[Phase, ...], sway_m: float) -> Floats:
    """Lateral displacement (n,) in walking, once to each side per stride."""
    aside = np.zeros(len(t))
    walks = iter([hold for hold in day if hold.posture in STEPPING])
    for phase in phases:
        if phase.kind in STEPPING:
            pace = next(walks).steps_per_min / 60.0
            into, left = t - phase.start_s, phase.end_s - t
            going = smoothstep(into / STARTING_S) * smoothstep(left / STARTING_S)
            aside += sway_m * going * np.sin(np.pi * pace * into)
    return aside


def _way(
    t: Floats, day: Day, phases: tuple[Phase, ...], style: ChestStyle
) -> tuple[Floats, Floats, Floats, Floats]:
    """Height and pitch (n,), forward displacement (n,) of the reference person, and times of the steps."""
    start = POSTURES[_upright(day[0].posture)]
    height, pitch, forward = (
        np.full(len(t), start.height_m),
        np.full(len(t), start.pitch_rad),
        np.zeros(len(t)),
    )
    walks = iter([hold for hold in day if hold.posture in STEPPING])
    steps: list[Floats] = []
    for phase in phases:
        u = (t - phase.start_s) / (phase.end_s - phase.start_s)
        if phase.kind in STEPPING:
            pace = next(walks).steps_per_min / 60.0
            lean, rocks = STEPPING[phase.kind]  # type: ignore[index]
            if lean or rocks:
                into, left = t - phase.start_s, phase.end_s - t
                going = smoothstep(into / STARTING_S) * smoothstep(left / STARTING_S)
                pitch += going * (lean + rocks * np.sin(2.0 * np.pi * ROCKING_HZ * into))
            steps.append(_walk(t, phase, pace, height, pitch, forward))
        elif phase.kind == "bow":
            bent = style.bow_rad * bump(u)
            pitch += bent
            height -= TRUNK_M * (1.0 - np.cos(bent))
        elif "_to_" in phase.kind:
            a, b = (POSTURES[name] for name in phase.kind.split("_to_"))  # type: ignore[index]
            rises = b.height_m > a.height_m
            lifted = smoothstep((u - 1.0 + LIFTING) / LIFTING) if rises else smoothstep(u / LIFTING)
            height += (b.height_m - a.height_m) * lifted
            pitch += (b.pitch_rad - a.pitch_rad) * smoothstep(u)
            if "lie" not in phase.kind:
                pitch += style.lean_rad * bump(u)
                forward += (FORWARD_M if rises else -FORWARD_M) * smoothstep(u)
    return height, pitch, forward, np.concatenate(steps) if steps else np.empty(0)


def _walk(t: Floats, phase: Phase, pace_hz: float, height: Floats, pitch: Floats, forward: Floats) -> Floats:
    """Add one walk in place; returns the times of the highest points of its steps."""
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
        shortest = 2.0 * STARTING_S if hold.posture in STEPPING else 0.0
        if hold.posture == "lie_side":
            shortest = 2.0 * ROLL_S
        if not (np.isfinite(hold.duration_s) and hold.duration_s > shortest):
            raise ParameterError(
                "day_item",
                f"Item {i} ({hold.posture}) lasts {hold.duration_s:g} s; expected above {shortest:g} s.",
            )
        if not 30.0 <= hold.steps_per_min <= 240.0:
            raise ParameterError(
                "day_item", f"Item {i}: {hold.steps_per_min:g} steps per minute; expected 30 to 240."
            )
