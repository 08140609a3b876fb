"""Squats on one leg: a still foot and a chain of three links on it, in closed form
(docs/science/simulation.md, "Squat").

For estimators that build on a fixed foot (Kianifar et al.: sensors on shank, thigh and lower back) and as a
motion that breaks those made for walking. The free leg is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from typing import Final

import numpy as np

from core.errors import ParameterError
from core.frames import FOOT, SHANK, THIGH, Floats, Segment, Side
from core.rotation import about, multiply, rotate
from core.simulate.human import BodyPath
from core.simulate.phases import Phase
from core.simulate.recorder import Draws, Recorded, oversampling, record
from core.simulate.sensors import PLACES, Mount, draw_mounts, place_sensor
from core.simulate.setup import RecordingSetup
from core.simulate.shapes import smoothstep
from core.simulate.stance import Q_NEUTRAL
from core.simulate.truth import joint_angles
from core.simulate.walker import SIGN, Anatomy, Walker

DOWN: Final = 0.52
"""Share of the moving time spent on the way down."""

ANKLE_PER_KNEE: Final = 0.42
"""Dorsiflexion that comes with knee flexion, rad per rad."""


@dataclass(frozen=True)
class Squats:
    """What is done; angles at the depth asked for, in standing otherwise.

    Parameters
    ----------
    depth_rad : knee flexion added to standing, varying by `spread` (relative SD, limited to two).
    moving_s : down and up together. hold_s : at the bottom. rest_s : standing after each. lead_s : before.
    valgus_rad : knee falling inward. trunk_rad : forward lean of the pelvis.
    hinged : the knee is a hinge: it falls inward because the shank turns and leans inward, and the hip
        follows; else it opens sideways itself.
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

    def __post_init__(self) -> None:
        deepest = self.standing_knee_rad + self.depth_rad * (1.0 + 2.0 * self.spread)
        if not (self.depth_rad > 0.0 and deepest < radians(150.0)):
            raise ParameterError(
                "squat_depth", f"The knee would bend to {np.degrees(deepest):.0f}°; expected up to 150°."
            )
        times = (self.moving_s, self.hold_s, self.rest_s, self.lead_s)
        if self.repetitions < 1 or not all(np.isfinite(t) and t > 0.0 for t in times):
            raise ParameterError(
                "squat_times", f"{self.repetitions} squats with times {times} s; expected all above 0."
            )

    @property
    def cycle_s(self) -> float:
        """One squat and the rest after it."""
        return self.moving_s + self.hold_s + self.rest_s


@dataclass(frozen=True, eq=False)
class SquatTruth:
    """Exact truth at the samples of the recording.

    Parameters
    ----------
    t_s : (n,). q : segment → (n, 4), p : segment → (n, 3) m; the ankle of the foot stands over the origin.
    angles : name → (n,) rad as in core/angles, anatomical. zero_offset : name → value in standing, rad.
    phases : "stand", "down", "hold", "up" in turn over the whole take.
    depths_rad : drawn knee flexion added in each squat.
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
        """Angles (n,) in rad minus their standing value."""
        return {name: values - self.zero_offset[name] for name, values in self.angles.items()}


@dataclass(frozen=True, eq=False)
class SquatSimulation(Recorded):
    """A recording of squats and what really happened."""

    truth: SquatTruth


def simulate_squats(
    squats: Squats | None = None,
    height_m: float = 1.75,
    seed: int = 0,
    setup: RecordingSetup | None = None,
    mounts: Mapping[Segment, Mount] | None = None,
) -> SquatSimulation:
    """Let a person of a height squat on one leg, with sensors on its foot, shank, thigh and on the pelvis.

    Parameters
    ----------
    mounts : how sensors sit; those that are not given are drawn.

    Raises
    ------
    ParameterError : "squat_depth", "squat_times", "height_implausible".
    """
    squats, setup, draws = squats or Squats(), setup or RecordingSetup(), Draws(seed)
    person = Walker.of_height(height_m)
    every = oversampling(setup.rate_hz)
    rate = every * setup.rate_hz
    duration = squats.lead_s + squats.repetitions * squats.cycle_s + 1.0
    t = np.arange(round(duration * rate) + 1) / rate
    chance = np.clip(draws.steps.standard_normal(squats.repetitions), -2.0, 2.0)
    deep = np.asarray(1.0 + squats.spread * chance)
    starts = squats.lead_s + squats.cycle_s * np.arange(squats.repetitions, dtype=np.float64)
    q, p = _poses(_depth(t, squats, starts, deep), squats, person.anatomy)

    places = {segment: PLACES[segment] for segment in q}
    drawn = draw_mounts(places, person.scale, setup.mount_spread_rad, draws.mounts)
    mounts = drawn | {segment: mount for segment, mount in (mounts or {}).items() if segment in drawn}
    body = BodyPath(t, q, p)
    paths = {s: place_sensor(body, s, mount, setup.tissue) for s, mount in mounts.items()}
    made = record(paths, setup, draws, height_m, protocol="squat")

    q, p = ({s: a[::every] for s, a in of.items()} for of in (q, p))
    angles = joint_angles(q)
    truth = SquatTruth(
        t_s=t[::every],
        rate_hz=setup.rate_hz,
        q=q,
        p=p,
        angles=angles,
        zero_offset={name: float(values[0]) for name, values in angles.items()},
        phases=_phases(squats, starts, float(t[-1])),
        depths_rad=tuple((squats.depth_rad * deep).tolist()),
        mounts=mounts,
    )
    return SquatSimulation(**vars(made), truth=truth)


def _depth(t: Floats, squats: Squats, starts: Floats, deep: Floats) -> Floats:
    """How deep (n,) the person is, 0 standing, 1 at the depth asked for."""
    depth = np.zeros(len(t))
    down, up = DOWN * squats.moving_s, (1.0 - DOWN) * squats.moving_s
    for start, share in zip(starts, deep, strict=True):
        into = t - start
        depth += share * (smoothstep(into / down) - smoothstep((into - down - squats.hold_s) / up))
    return depth


def _poses(
    depth: Floats, squats: Squats, anatomy: Anatomy
) -> tuple[dict[Segment, Floats], dict[Segment, Floats]]:
    """Orientations (n, 4) and origins (n, 3) in m of foot, shank, thigh and pelvis, from the floor up."""
    side, inward = squats.side, SIGN[squats.side] * squats.valgus_rad * depth
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
    ankle_joint = np.tile([0.0, 0.0, anatomy.ankle_height], (len(depth), 1))
    knee_joint = ankle_joint + rotate(shank, np.array([0.0, anatomy.shank, 0.0]))
    hip_joint = knee_joint + rotate(thigh, np.array([0.0, anatomy.thigh, 0.0]))
    aside = np.array([0.0, 0.0, SIGN[side] * anatomy.hip_width / 2.0])
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
