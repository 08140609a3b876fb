"""Script of a simulated walk: its items, and the resulting footprints.

Each walking item is divided into steps; before standing a short closing step brings the feet together. Each
step has its own random deviations, so the footprints are the exact truth (docs/science/simulation.md,
"Footprints").
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import cos, inf, sin, sqrt

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import SIDES, Side
from sagittal.core.simulate.walker import SIGN, Walker

CLOSING = 0.4
"""Length of a closing step relative to the step before."""

CLIP = 2.5
"""Drawn deviations are limited to so many standard deviations."""


@dataclass(frozen=True)
class Move:
    """One step as planned: forward length in m, turn in rad (left positive), duration in s."""

    length_m: float
    turn_rad: float
    duration_s: float


@dataclass(frozen=True)
class Stand:
    """Quiet standing."""

    duration_s: float


@dataclass(frozen=True)
class Straight:
    """Walk straight ahead."""

    length_m: float
    step_m: float
    step_s: float

    def moves(self) -> list[Move]:
        """Steps of this item."""
        n = max(1, round(self.length_m / self.step_m))
        return [Move(self.step_m, 0.0, self.step_s)] * n


@dataclass(frozen=True)
class Arc:
    """Walk along a circle of `radius_m` through `angle_rad` (left positive)."""

    radius_m: float
    angle_rad: float
    step_m: float
    step_s: float

    def moves(self) -> list[Move]:
        """Steps of this item, all equal."""
        length = self.radius_m * abs(self.angle_rad)
        n = max(1, round(length / self.step_m))
        return [Move(length / n, self.angle_rad / n, self.step_s)] * n


@dataclass(frozen=True)
class Pivot:
    """Turn on the spot by `angle_rad` (left positive) with about `per_step_rad` per step."""

    angle_rad: float
    per_step_rad: float
    step_s: float

    def moves(self) -> list[Move]:
        """Steps of this item, all equal."""
        n = max(1, round(abs(self.angle_rad) / self.per_step_rad))
        return [Move(0.0, self.angle_rad / n, self.step_s)] * n


@dataclass(frozen=True)
class SingleSteps:
    """Single steps, each (forward length in m, turn in rad to the left, duration in s): e.g. festination."""

    steps: tuple[tuple[float, float, float], ...]

    def moves(self) -> list[Move]:
        """The steps as given."""
        return [Move(*step) for step in self.steps]


Item = Stand | Straight | Arc | Pivot | SingleSteps
Script = tuple[Item, ...]


def scale_script(script: Script, k: float) -> Script:
    """The same script with all lengths multiplied by k, for a person taller by the factor k."""
    return tuple(
        SingleSteps(tuple((k * length, turn, duration) for length, turn, duration in item.steps))
        if isinstance(item, SingleSteps)
        else replace(item, **{name: k * value for name, value in vars(item).items() if name.endswith("_m")})
        for item in script
    )


@dataclass(frozen=True)
class Footprint:
    """Position and time of a landing foot.

    Parameters
    ----------
    time_s : initial contact; −inf for the two initial footprints.
    x_m, y_m : floor point below the ankle centre with the foot flat.
    path_rad : heading of the body's path. foot_rad : heading of the foot (with toe-out). Both unwrapped.
    step_m, step_s : length and duration of the step that ends here, including random deviations. opens,
        closes : first step after standing, last before standing. pitch_rad, knee_rad, hip_rad : random
        deviations of this step's angles.
    """

    side: Side
    time_s: float
    x_m: float
    y_m: float
    path_rad: float
    foot_rad: float
    step_m: float
    step_s: float
    opens: bool = False
    closes: bool = False
    pitch_rad: float = 0.0
    knee_rad: float = 0.0
    hip_rad: float = 0.0

    @property
    def start_s(self) -> float:
        """Start of the step: the other foot's contact, or the end of standing."""
        return self.time_s - self.step_s


@dataclass(frozen=True)
class Plan:
    """The footprints of a script.

    Parameters
    ----------
    steps : all steps in chronological order. footprints : side → its initial footprint, then its steps.
        stands : (start, end) of each standing period in s.
    """

    steps: tuple[Footprint, ...]
    footprints: dict[Side, tuple[Footprint, ...]]
    stands: tuple[tuple[float, float], ...]
    duration_s: float

    @property
    def typical_step_s(self) -> float:
        """Median step time; the unit of smoothing windows."""
        return float(np.median([s.step_s for s in self.steps])) if self.steps else 0.5


def plan(script: Script, walker: Walker, rng: np.random.Generator) -> Plan:
    """Convert a script to footprints, starting at the origin with heading +x, right foot first.

    Raises
    ------
    ParameterError : "script_standing" if it does not start and end with standing, "script_item" if a length,
        a radius or a time is not positive.
    """
    _check(script)
    walk = _Walk(walker, rng)
    first = {
        s: Footprint(s, -inf, fx, fy, 0.0, foot, 0.0, inf)
        for s in SIDES
        for fx, fy, foot in (walk.land(s, 0.0),)
    }
    for item, following in zip(script, (*script[1:], Stand(1.0)), strict=True):
        if isinstance(item, Stand):
            walk.stand(item.duration_s)
            continue
        moves = item.moves()
        closing = isinstance(following, Stand)
        if closing:
            moves = [*moves, Move(CLOSING * moves[-1].length_m, 0.0, moves[-1].duration_s)]
        for i, move in enumerate(moves):
            walk.step(move, closes=closing and i == len(moves) - 1)
    footprints = {s: (first[s], *(f for f in walk.steps if f.side == s)) for s in SIDES}
    return Plan(tuple(walk.steps), footprints, tuple(walk.stands), walk.t)


@dataclass
class _Walk:
    """State of a walk: position, time, next foot, and footprints so far."""

    walker: Walker
    rng: np.random.Generator
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    t: float = 0.0
    side: Side = "right"
    opens: bool = True
    steps: list[Footprint] = field(default_factory=list)
    stands: list[tuple[float, float]] = field(default_factory=list)

    def land(self, side: Side, wider_m: float) -> tuple[float, float, float]:
        """Lateral position of a footprint relative to the path, and its direction."""
        lateral = -SIGN[side] * (self.walker.width_m / 2.0 + wider_m)
        foot = self.heading - SIGN[side] * self.walker.sides[side].toe_out_rad
        return self.x - lateral * sin(self.heading), self.y + lateral * cos(self.heading), foot

    def stand(self, duration_s: float) -> None:
        """Quiet standing; the next step opens a walk."""
        self.stands.append((self.t, self.t + duration_s))
        self.t += duration_s
        self.opens = True

    def step(self, move: Move, *, closes: bool) -> None:
        """One step of the next foot."""
        spread = self.walker.variability
        g = np.clip(self.rng.standard_normal(6), -CLIP, CLIP)
        gait = self.walker.sides[self.side]
        length = move.length_m * gait.length_factor * (1.0 + spread.step_length * g[0])
        # two steps make a stride: √2 keeps the stride's variation at the asked value
        duration = move.duration_s * gait.time_factor * (1.0 + sqrt(2.0) * spread.step_time * g[1])
        self.heading += move.turn_rad / 2.0
        self.x += length * cos(self.heading)
        self.y += length * sin(self.heading)
        self.heading += move.turn_rad / 2.0
        self.t += duration
        fx, fy, foot = self.land(self.side, spread.width_m * g[2])
        self.steps.append(
            Footprint(
                side=self.side,
                time_s=self.t,
                x_m=fx,
                y_m=fy,
                path_rad=self.heading,
                foot_rad=foot,
                step_m=length,
                step_s=duration,
                opens=self.opens,
                closes=closes,
                pitch_rad=spread.pitch_rad * g[3],
                knee_rad=spread.knee_rad * g[4],
                hip_rad=spread.hip_rad * g[5],
            )
        )
        self.opens = False
        self.side = "left" if self.side == "right" else "right"


def _check(script: Script) -> None:
    if not script or not isinstance(script[0], Stand) or not isinstance(script[-1], Stand):
        raise ParameterError(
            "script_standing", "A script starts and ends with standing; add Stand(5) at both ends."
        )
    for i, item in enumerate(script):
        if isinstance(item, SingleSteps):
            _check_steps(i, item)
            continue
        for name, value in vars(item).items():
            if not (np.isfinite(value) and (value > 0.0 or name == "angle_rad")):
                raise ParameterError(
                    "script_item",
                    f"Item {i} of the script ({type(item).__name__}): {name} is {value:g}, expected above 0.",
                )


def _check_steps(i: int, item: SingleSteps) -> None:
    for j, (length, turn, duration) in enumerate(item.steps):
        if not (np.isfinite((length, turn, duration)).all() and length >= 0.0 and duration > 0.0):
            raise ParameterError(
                "script_item",
                f"Item {i} of the script (Steps): step {j} is ({length:g} m, {turn:g} rad, {duration:g} s)."
                " Expected a length of 0 or more and a duration above 0.",
            )
    if not item.steps:
        raise ParameterError("script_item", f"Item {i} of the script (Steps) has no steps.")
