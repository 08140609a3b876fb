"""Functional calibration movements with ground truth: swings of each leg from the hip, and bows of the trunk
(docs/science/simulation.md, "Swings and bows").

The person is in standing; the supporting leg and the arms are still except for sway. Real movements are not
about a single axis: the swinging leg also abducts and rotates a little, and the trunk leans a little to the
side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from typing import Final

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Floats, Segment, Side
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

RAMP_S: Final = 0.6
"""The first and the last of a run grow and fade over this time."""


@dataclass(frozen=True)
class SwingsAndBows:
    """Sequence of movements: standing, swings of each leg, bows, with standing in between.

    Parameters
    ----------
    swings, bows : number for each leg, for the trunk; 0 omits them. sides : order of the legs.
    forward_rad, backward_rad : of the thigh from standing. aside_rad, turned_rad : abduction and rotation
        about its long axis. aside_per_swing : lateral movements per swing or bow; 1 tilts the main axis
        itself.
    knee_rad : flexion during leg swing. bow_rad : of the pelvis. sway_rad : lateral, of the pelvis.
    swing_s, bow_s : duration of one. lead_s, rest_s : standing at the beginning, and after each series.
    """

    swings: int = 12
    bows: int = 6
    sides: tuple[Side, ...] = ("right", "left")
    forward_rad: float = radians(35.0)
    backward_rad: float = radians(10.0)
    aside_rad: float = radians(2.0)
    turned_rad: float = radians(2.0)
    aside_per_swing: float = 0.37
    knee_rad: float = radians(6.0)
    bow_rad: float = radians(45.0)
    sway_rad: float = radians(2.0)
    swing_s: float = 2.0
    bow_s: float = 4.0
    lead_s: float = 5.0
    rest_s: float = 3.0

    def __post_init__(self) -> None:
        times = (self.swing_s, self.bow_s, self.lead_s, self.rest_s)
        if self.swings < 0 or self.bows < 0 or not all(np.isfinite(t) and t > 0.0 for t in times):
            raise ParameterError(
                "functional_times",
                f"{self.swings} swings and {self.bows} bows with times {times} s; expected 0 or more, and "
                "times above 0.",
            )


@dataclass(frozen=True, eq=False)
class FunctionalTruth:
    """Exact ground truth at the samples of the recording.

    Parameters
    ----------
    t_s : (n,). q : segment → (n, 4), p : segment → (n, 3) m. angles : name → (n,) rad as in core/angles.
    phases : "stand", "swing_left", "swing_right", "bow" in order. mounts : position and alignment of the
        sensors.
    """

    t_s: Floats
    rate_hz: float
    q: Mapping[Segment, Floats]
    p: Mapping[Segment, Floats]
    angles: Mapping[str, Floats]
    phases: tuple[Phase, ...]
    mounts: Mapping[Segment, Mount]


@dataclass(frozen=True, eq=False)
class FunctionalSimulation(Recorded):
    """A recording of swings and bows with its ground truth."""

    truth: FunctionalTruth


def simulate_swings_and_bows(
    does: SwingsAndBows | None = None,
    height_m: float = 1.75,
    seed: int = 0,
    setup: RecordingSetup | None = None,
) -> FunctionalSimulation:
    """Simulate a person of a height swinging the legs and bowing, with seven sensors.

    Raises
    ------
    ParameterError : "functional_times", "height_implausible".
    """
    does, setup, draws = does or SwingsAndBows(), setup or RecordingSetup(), Draws(seed)
    person = Walker.of_height(height_m)
    every = oversampling(setup.rate_hz)
    rate = every * setup.rate_hz
    phases = _plan(does)
    t = np.arange(round(phases[-1].end_s * rate) + 1) / rate
    q, p = _pose(t, phases, does, person.anatomy, draws.steps)
    mounts = draw_mounts({s: PLACES[s] for s in q}, person.scale, setup.mount_spread_rad, draws.mounts)
    body = BodyPath(t, q, p)
    paths = {s: place_sensor(body, s, mount, setup.tissue) for s, mount in mounts.items()}
    recorded = record(paths, setup, draws, height_m)
    q, p = ({s: a[::every] for s, a in by_segment.items()} for by_segment in (q, p))
    truth = FunctionalTruth(t[::every], setup.rate_hz, q, p, joint_angles(q), phases, mounts)
    return FunctionalSimulation(**vars(recorded), truth=truth)


def _plan(does: SwingsAndBows) -> tuple[Phase, ...]:
    phases, now = [Phase("stand", 0.0, does.lead_s)], does.lead_s
    runs = [(f"swing_{side}", does.swings * does.swing_s) for side in does.sides]
    for name, lasts in (*runs, ("bow", does.bows * does.bow_s)):
        if lasts:
            phases += [
                Phase(name, now, now + lasts),
                Phase("stand", now + lasts, now + lasts + does.rest_s),
            ]
            now += lasts + does.rest_s
    return tuple(phases)


def _pose(
    t: Floats, phases: tuple[Phase, ...], does: SwingsAndBows, anatomy: Anatomy, rng: np.random.Generator
) -> tuple[dict[Segment, Floats], dict[Segment, Floats]]:
    """Orientations (n, 4) and origins (n, 3) in m of seven segments; the pelvis is above the supporting
    feet.
    """
    zero = np.zeros(len(t))
    hip = {side: (zero.copy(), zero.copy(), zero.copy(), zero.copy()) for side in SIDES}
    bow, sway = zero.copy(), zero.copy()
    for phase in phases:
        if phase.kind == "stand":
            continue
        into = t - phase.start_s
        envelope = smoothstep(into / RAMP_S) * smoothstep((phase.end_s - t) / RAMP_S)
        start, turn = rng.uniform(0.0, 2.0 * np.pi, 2)
        if phase.kind == "bow":
            cycle = 2.0 * np.pi * into / does.bow_s
            bow += envelope * does.bow_rad * 0.5 * (1.0 - np.cos(cycle))
            sway += envelope * does.sway_rad * np.sin(does.aside_per_swing * cycle + start)
            continue
        side: Side = "left" if phase.kind == "swing_left" else "right"
        cycle = 2.0 * np.pi * into / does.swing_s
        flexion, aside, turned, knee = hip[side]
        middle_rad = 0.5 * (does.forward_rad - does.backward_rad)
        flexion += envelope * (middle_rad + 0.5 * (does.forward_rad + does.backward_rad) * np.sin(cycle))
        aside += envelope * does.aside_rad * np.sin(does.aside_per_swing * cycle + start)
        turned += envelope * does.turned_rad * np.sin(cycle + turn)
        knee += envelope * does.knee_rad
    pelvis = multiply(multiply(Q_NEUTRAL, about(2, -bow)), about(0, sway))
    q: dict[Segment, Floats] = {"pelvis": pelvis}
    middle = np.tile([0.0, 0.0, anatomy.ankle_height + anatomy.shank + anatomy.thigh], (len(t), 1))
    p: dict[Segment, Floats] = {"pelvis": middle}
    for side in SIDES:
        flexion, aside, turned, knee = hip[side]
        thigh = multiply(multiply(Q_NEUTRAL, about(2, flexion)), about(0, SIGN[side] * aside))
        thigh = multiply(thigh, about(1, turned))
        shank = multiply(thigh, about(2, -knee))
        joint = middle + rotate(Q_NEUTRAL, np.array([0.0, 0.0, SIGN[side] * anatomy.hip_width / 2.0]))
        knee_centre = joint + rotate(thigh, np.array([0.0, -anatomy.thigh, 0.0]))
        ankle = knee_centre + rotate(shank, np.array([0.0, -anatomy.shank, 0.0]))
        q |= {THIGH[side]: thigh, SHANK[side]: shank, FOOT[side]: shank}
        p |= {THIGH[side]: joint, SHANK[side]: knee_centre, FOOT[side]: ankle}
    return q, p
