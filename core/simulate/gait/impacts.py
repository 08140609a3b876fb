"""Impacts at contact: vibration of every sensor of the leg and the pelvis relative to its segment for a tenth
of a second.

It is modelled as motion of the sensor, so acceleration, rate and pose are consistent; the segment itself is
not affected. Amplitude and frequency resemble shoes on a hard floor, they are not measured
(docs/science/simulation.md, "Impacts").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np

from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Floats, Segment, Side
from sagittal.core.simulate.gait.human import Motion


@dataclass(frozen=True)
class Shake:
    """Response of a kind of segment to a contact of strength 1.

    Parameters
    ----------
    acc : upward, m/s², and rate, rad/s about the segment's z axis, of an undamped oscillation; the short
        decay of the actual one makes its peaks up to 1.45 times larger.
    hz : of the oscillation. delay_s, duration_s : after the contact.
    """

    acc: float
    hz: float
    delay_s: float
    duration_s: float
    rate: float


SHAKES: Final[Mapping[str, Shake]] = {
    "foot": Shake(70.0, 28.0, 0.0, 0.085, 2.0),
    "shank": Shake(26.0, 22.0, 0.006, 0.100, 0.7),
    "thigh": Shake(11.0, 16.0, 0.012, 0.120, 0.4),
    "pelvis": Shake(5.0, 13.0, 0.016, 0.140, 0.15),
}

REFERENCE_MPS: Final = 1.2
"""Walking speed at which the strength is 1."""

HARDEST: Final = 1.4
"""Strength of the hardest steps, before it varies from step to step."""

SPREAD: Final = 0.25
"""Standard deviation of the logarithm of the strength; drawn values are limited to two of it."""

BACKWARD: Final = 0.45
"""Share of the shake against the walking direction; the rest of it is upward."""

PEAK: Final = 1.0 / 3.0
"""Share of the duration at which the shake is largest: where u⁴(1 − u)⁸ is."""


@dataclass(frozen=True)
class Impact:
    """One contact: foot, time of contact and of foot-flat (s), heading (rad), strength."""

    side: Side
    time_s: float
    flat_s: float
    heading_rad: float
    strength: float


def draw_impacts(motion: Motion, rng: np.random.Generator) -> tuple[Impact, ...]:
    """One impact per step, stronger for faster steps."""
    impacts = []
    for side in SIDES:
        timing = motion.timings[side]
        for foot, flat in zip(motion.plan.footprints[side][1:], timing.flat, strict=True):
            pace = max(foot.step_m, 0.0) / max(foot.step_s, 0.2) / REFERENCE_MPS
            chance = float(np.exp(SPREAD * np.clip(rng.standard_normal(), -2.0, 2.0)))
            strength = motion.walker.impact * min(HARDEST, pace) * chance
            impacts.append(Impact(side, foot.time_s, float(flat), foot.path_rad, strength))
    return tuple(impacts)


def shake_sensor(t: Floats, segment: Segment, impacts: tuple[Impact, ...]) -> tuple[Floats, Floats]:
    """Displacement (n, 3) in m in the world and turn (n,) in rad about the segment's z axis of its sensor.

    Both are exactly zero from foot-flat on for a foot, and after the vibration for the others.
    """
    shift, turn = np.zeros((len(t), 3)), np.zeros(len(t))
    shake = SHAKES[segment.split("_")[0]]
    for hit in impacts:
        if segment not in ("pelvis", THIGH[hit.side], SHANK[hit.side], FOOT[hit.side]):
            continue
        start = hit.time_s + shake.delay_s
        duration = shake.duration_s
        if segment == FOOT[hit.side]:
            duration = min(duration, hit.flat_s - start)
        part = slice(*np.searchsorted(t, (start, start + duration)).tolist())
        u = (t[part] - start) / duration
        fade = u**4 * (1.0 - u) ** 8 / (PEAK**4 * (1.0 - PEAK) ** 8)
        omega = 2.0 * pi * shake.hz
        wave = hit.strength * fade * np.cos(omega * duration * (u - PEAK))
        direction = [-BACKWARD * np.cos(hit.heading_rad), -BACKWARD * np.sin(hit.heading_rad), 1.0]
        shift[part] += (shake.acc / omega**2) * wave[:, None] * direction
        turn[part] += shake.rate / omega * wave
    return shift, turn
