"""Squats: a still foot and a chain of three links on it, in closed form (docs/science/simulation.md,
"Squat").

For estimators that assume a fixed foot (Kianifar et al.: sensors on shank, thigh and lower back) and as a
motion that violates the assumptions of those made for walking. The other leg is omitted, or lifted until its
turn, or squats as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from typing import Final, Literal

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import FOOT, SHANK, THIGH, Floats, Segment, Side
from sagittal.core.rotation import about, multiply, rotate
from sagittal.core.simulate.gait.human import BodyPath
from sagittal.core.simulate.gait.stance import Q_NEUTRAL
from sagittal.core.simulate.phases import Phase
from sagittal.core.simulate.recorder import Draws, Recorded, oversampling, record
from sagittal.core.simulate.sensors import PLACES, Mount, draw_mounts, place_sensor
from sagittal.core.simulate.setup import RecordingSetup
from sagittal.core.simulate.shapes import smoothstep
from sagittal.core.simulate.truth import joint_angles
from sagittal.core.simulate.walker import SIGN, Anatomy, Walker

DOWN: Final = 0.52
"""Share of the moving time spent on the way down."""

ANKLE_PER_KNEE: Final = 0.42
"""Dorsiflexion that comes with knee flexion, rad per rad."""

OtherLeg = Literal["left_out", "lifted", "along"]

LIFT_S: Final = 1.0
"""Time in which the other foot leaves the floor, and in which it comes back."""

LIFTED_THIGH: Final = (radians(20.0), radians(25.0))
LIFTED_KNEE: Final = (radians(60.0), radians(30.0))
"""Forward turn of the thigh and flexion of the knee of a lifted leg: when the other stands, and what is added
at the depth asked for, so that the foot never meets the floor."""

WOBBLE_RAD, WOBBLE_HZ = radians(3.0), 0.6
"""A lifted leg does not hold still."""


@dataclass(frozen=True)
class Squats:
    """Parameters of the movement; angles at full depth, in standing otherwise.

    Parameters
    ----------
    depth_rad : knee flexion added to standing, varying by `spread` (relative SD, limited to two). moving_s :
        descent and ascent together. hold_s : at the lowest point. rest_s : standing after each. lead_s :
        before.
    valgus_rad : dynamic knee valgus. trunk_rad : forward lean of the pelvis. hinged : the knee is a hinge:
        valgus arises because the shank rotates and leans inward, and the hip follows; else the knee itself
        abducts. other : the leg of the other side has no sensors and is omitted; or its foot is lifted while
        this leg squats, and they then change roles; or both squat together on both feet, which requires
        `valgus_rad` 0: a level pelvis closes the chain.
    """

    side: Side = "right"
    repetitions: int = 5
    depth_rad: float = radians(70.0)
    spread: float = 0.06
    moving_s: float = 3.2
    hold_s: float = 0.3
    rest_s: float = 1.0
    lead_s: float = 4.0
    valgus_rad: float = radians(8.0)
    trunk_rad: float = radians(25.0)
    standing_knee_rad: float = radians(5.0)
    standing_ankle_rad: float = radians(2.0)
    standing_tilt_rad: float = radians(8.0)
    hinged: bool = False
    other: OtherLeg = "left_out"

    def __post_init__(self) -> None:
        deepest = self.standing_knee_rad + self.depth_rad * (1.0 + 2.0 * self.spread)
        if not (self.depth_rad > 0.0 and deepest < radians(150.0)):
            raise ParameterError(
                "squat_depth", f"The knee would bend to {np.degrees(deepest):.0f}°; expected up to 150°."
            )
        if self.other == "along" and self.valgus_rad != 0.0:
            raise ParameterError("squat_valgus", "Squats on both feet are simulated without valgus only.")
        times = (self.moving_s, self.hold_s, self.rest_s, self.lead_s)
        if self.repetitions < 1 or not all(np.isfinite(t) and t > 0.0 for t in times):
            raise ParameterError(
                "squat_times", f"{self.repetitions} squats with times {times} s; expected all above 0."
            )

    @property
    def cycle_s(self) -> float:
        """Duration of one squat and the following rest."""
        return self.moving_s + self.hold_s + self.rest_s

    @property
    def sides(self) -> tuple[Side, ...]:
        """The squatting legs, in the order in which they begin."""
        opposite: Side = "left" if self.side == "right" else "right"
        return (self.side,) if self.other == "left_out" else (self.side, opposite)

    @property
    def turns(self) -> int:
        """Number of series of `repetitions` squats."""
        return 2 if self.other == "lifted" else 1

    @property
    def turn_s(self) -> float:
        """Duration of a series: the squats, and lifting the other foot before and after them."""
        lifts = 2.0 * (LIFT_S + self.rest_s) if self.other == "lifted" else 0.0
        return self.repetitions * self.cycle_s + lifts

    @property
    def starts_s(self) -> Floats:
        """Start times (turns, repetitions), s."""
        first = self.lead_s + (LIFT_S + self.rest_s if self.other == "lifted" else 0.0)
        squats = self.cycle_s * np.arange(self.repetitions, dtype=np.float64)
        return first + squats + self.turn_s * np.arange(self.turns, dtype=np.float64)[:, None]


@dataclass(frozen=True, eq=False)
class SquatTruth:
    """Exact ground truth at the samples of the recording.

    Parameters
    ----------
    t_s : (n,). q : segment → (n, 4), p : segment → (n, 3) m; the ankle of the foot is above the origin.
    angles : name → (n,) rad as in core/angles, anatomical. zero_offset : name → value in standing, rad.
    phases : "stand", "down", "hold", "up" in order over the whole recording. depths_rad : random knee flexion
        added in each squat, in chronological order.
    """

    t_s: Floats
    rate_hz: float
    q: Mapping[Segment, Floats]
    p: Mapping[Segment, Floats]
    angles: Mapping[str, Floats]
    zero_offset: Mapping[str, float]
    phases: tuple[Phase, ...]
    depths_rad: tuple[float, ...]
    mounts: Mapping[Segment, Mount]

    def subtract_standing(self) -> dict[str, Floats]:
        """Angles (n,) in rad minus their value in standing."""
        return {name: values - self.zero_offset[name] for name, values in self.angles.items()}


@dataclass(frozen=True, eq=False)
class SquatSimulation(Recorded):
    """A recording of squats with its ground truth."""

    truth: SquatTruth


def simulate_squats(
    squats: Squats | None = None,
    height_m: float = 1.75,
    seed: int = 0,
    setup: RecordingSetup | None = None,
    mounts: Mapping[Segment, Mount] | None = None,
) -> SquatSimulation:
    """Simulate squats of a person of a height, with sensors on foot, shank and thigh of the legs and on the
    pelvis.

    Parameters
    ----------
    mounts : position and alignment of sensors; random if not given.

    Raises
    ------
    ParameterError : "squat_depth", "squat_times", "height_implausible".
    """
    squats, setup, draws = squats or Squats(), setup or RecordingSetup(), Draws(seed)
    person = Walker.of_height(height_m)
    every = oversampling(setup.rate_hz)
    rate = every * setup.rate_hz
    duration = squats.lead_s + squats.turns * squats.turn_s + 1.0
    t = np.arange(round(duration * rate) + 1) / rate
    chance = np.clip(draws.steps.standard_normal(squats.turns * squats.repetitions), -2.0, 2.0)
    deep = np.asarray(1.0 + squats.spread * chance).reshape(squats.turns, squats.repetitions)
    q, p = _place_body(t, squats, deep, person.anatomy)

    places = {segment: PLACES[segment] for segment in q}
    drawn = draw_mounts(places, person.scale, setup.mount_spread_rad, draws.mounts)
    mounts = drawn | {segment: mount for segment, mount in (mounts or {}).items() if segment in drawn}
    body = BodyPath(t, q, p)
    paths = {s: place_sensor(body, s, mount, setup.tissue) for s, mount in mounts.items()}
    recorded = record(paths, setup, draws, height_m, protocol="squat")

    q, p = ({s: a[::every] for s, a in by_segment.items()} for by_segment in (q, p))
    angles = joint_angles(q)
    truth = SquatTruth(
        t_s=t[::every],
        rate_hz=setup.rate_hz,
        q=q,
        p=p,
        angles=angles,
        zero_offset={name: float(values[0]) for name, values in angles.items()},
        phases=_phases(squats, squats.starts_s.ravel(), float(t[-1])),
        depths_rad=tuple((squats.depth_rad * deep).ravel().tolist()),
        mounts=mounts,
    )
    return SquatSimulation(**vars(recorded), truth=truth)


def _depth(t: Floats, squats: Squats, starts: Floats, deep: Floats) -> Floats:
    """Depth (n,) of the squat, 0 in standing, 1 at full depth."""
    depth = np.zeros(len(t))
    down, up = DOWN * squats.moving_s, (1.0 - DOWN) * squats.moving_s
    for start, share in zip(starts, deep, strict=True):
        into = t - start
        depth += share * (smoothstep(into / down) - smoothstep((into - down - squats.hold_s) / up))
    return depth


def _place_body(
    t: Floats, squats: Squats, deep: Floats, anatomy: Anatomy
) -> tuple[dict[Segment, Floats], dict[Segment, Floats]]:
    """Orientations (n, 4) and origins (n, 3) in m of all segments; deep (turns, repetitions)."""
    depths = [_depth(t, squats, starts, shares) for starts, shares in zip(squats.starts_s, deep, strict=True)]
    legs = [_stand_on(squats, side, depths[0], anatomy) for side in squats.sides]
    if squats.other == "left_out":
        return legs[0]
    if squats.other == "along":
        return legs[0][0] | legs[1][0], legs[0][1] | legs[1][1]
    # the first turn up to the middle of the standing between both; until then nothing of the second moves
    split = int(np.searchsorted(t, squats.lead_s + squats.turn_s - 0.25 * squats.rest_s))
    first, second = squats.sides
    parts = [
        _stand_and_lift(t, squats, (a, b), k, depths[k], anatomy)
        for k, (a, b) in enumerate(((first, second), (second, first)))
    ]
    return tuple(  # type: ignore[return-value]
        {s: np.concatenate((parts[0][i][s][:split], parts[1][i][s][split:])) for s in parts[0][i]}
        for i in range(2)
    )


def _stand_and_lift(
    t: Floats, squats: Squats, sides: tuple[Side, Side], turn: int, depth: Floats, anatomy: Anatomy
) -> tuple[dict[Segment, Floats], dict[Segment, Floats]]:
    """Body that squats on the first side of a series and lifts the foot of the second."""
    carries, lifted = sides
    q, p = _stand_on(squats, carries, depth, anatomy)
    begin = squats.lead_s + turn * squats.turn_s
    end = begin + squats.turn_s - squats.rest_s - LIFT_S
    lift = smoothstep((t - begin) / LIFT_S) - smoothstep((t - end) / LIFT_S)
    wobble = WOBBLE_RAD * np.sin(2.0 * np.pi * WOBBLE_HZ * (t - begin))
    bent = squats.standing_knee_rad + lift * (LIFTED_KNEE[0] + LIFTED_KNEE[1] * depth)
    standing = squats.standing_knee_rad - squats.standing_ankle_rad
    forward = standing + lift * (LIFTED_THIGH[0] + LIFTED_THIGH[1] * depth + wobble)
    thigh = multiply(Q_NEUTRAL, about(2, forward))
    shank = multiply(thigh, about(2, -bent))
    foot = multiply(shank, about(2, np.full(len(t), squats.standing_ankle_rad)))
    hip = p["pelvis"] + rotate(q["pelvis"], np.array([0.0, 0.0, 0.5 * SIGN[lifted] * anatomy.hip_width]))
    knee = hip - rotate(thigh, np.array([0.0, anatomy.thigh, 0.0]))
    ankle = knee - rotate(shank, np.array([0.0, anatomy.shank, 0.0]))
    q |= {THIGH[lifted]: thigh, SHANK[lifted]: shank, FOOT[lifted]: foot}
    return q, p | {THIGH[lifted]: hip, SHANK[lifted]: knee, FOOT[lifted]: ankle}


def _stand_on(
    squats: Squats, side: Side, depth: Floats, anatomy: Anatomy
) -> tuple[dict[Segment, Floats], dict[Segment, Floats]]:
    """Orientations (n, 4) and origins (n, 3) in m of foot, shank, thigh and pelvis, from the floor up.

    The ankle is above the origin; with two legs each is displaced laterally by half the hip width.
    """
    inward = SIGN[side] * squats.valgus_rad * depth
    knee = squats.standing_knee_rad + squats.depth_rad * depth
    ankle = squats.standing_ankle_rad + ANKLE_PER_KNEE * squats.depth_rad * depth
    lean = squats.standing_tilt_rad + squats.trunk_rad * depth
    if squats.hinged:
        fallen = multiply(about(1, inward), about(0, -0.5 * inward))
        shank = multiply(multiply(Q_NEUTRAL, fallen), about(2, -ankle))
        thigh = multiply(shank, about(2, knee))
    else:
        shank = multiply(multiply(Q_NEUTRAL, about(2, -ankle)), about(0, -0.5 * inward))
        thigh = multiply(multiply(shank, about(2, knee)), about(0, inward))
    trunk = multiply(Q_NEUTRAL, about(2, -lean))
    aside = np.array([0.0, 0.0, SIGN[side] * anatomy.hip_width / 2.0])
    lateral = 0.0 if squats.other == "left_out" else -aside[2]
    ankle_joint = np.tile([0.0, lateral, anatomy.ankle_height], (len(depth), 1))
    knee_joint = ankle_joint + rotate(shank, np.array([0.0, anatomy.shank, 0.0]))
    hip_joint = knee_joint + rotate(thigh, np.array([0.0, anatomy.thigh, 0.0]))
    foot = np.tile(Q_NEUTRAL, (len(depth), 1))
    q: dict[Segment, Floats] = {"pelvis": trunk, THIGH[side]: thigh, SHANK[side]: shank, FOOT[side]: foot}
    middle = hip_joint - rotate(trunk, aside)
    p: dict[Segment, Floats] = {"pelvis": middle, THIGH[side]: hip_joint, SHANK[side]: knee_joint}
    return q, p | {FOOT[side]: ankle_joint}


def _phases(squats: Squats, starts: Floats, end_s: float) -> tuple[Phase, ...]:
    down, up = DOWN * squats.moving_s, (1.0 - DOWN) * squats.moving_s
    phases, now = [], 0.0
    for start in starts.tolist():
        bottom, rise = start + down, start + down + squats.hold_s
        phases += [Phase("stand", now, start), Phase("down", start, bottom)]
        phases += [Phase("hold", bottom, rise), Phase("up", rise, rise + up)]
        now = rise + up
    return (*phases, Phase("stand", now, end_s))
