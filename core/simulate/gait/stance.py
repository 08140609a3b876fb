"""The foot on the floor: heel rocker after contact, flat and exactly still, rolling forefoot at push-off.

A rigid foot that pivots about a point cannot reproduce human push-off (the ankle stays 4 cm too low at 60 %
of the cycle); the forefoot therefore rolls on a radius without slip (docs/science/simulation.md, "Contact
foot").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sagittal.core.frames import R_NEUTRAL, Floats, Side
from sagittal.core.rotation import about, from_matrix, multiply, rotate
from sagittal.core.simulate.gait.curves import FOOT_PITCH
from sagittal.core.simulate.gait.timing import RELEASE_PHASE, FootTiming
from sagittal.core.simulate.script import Footprint, Plan
from sagittal.core.simulate.shapes import smoothstep
from sagittal.core.simulate.walker import Walker

Q_NEUTRAL = from_matrix(R_NEUTRAL)
"""Orientation of every segment in neutral standing with heading +x."""


def foot_orientation(heading: Floats | float, pitch: Floats, roll: Floats | float = 0.0) -> Floats:
    """Quaternions (n, 4) of a foot: heading about the vertical, then pitch (toes up), then roll."""
    turned = multiply(about(2, heading), Q_NEUTRAL)
    return multiply(multiply(turned, about(2, pitch)), about(0, roll))


@dataclass(frozen=True, eq=False)
class Sole:
    """Points of the foot in foot axes, m (ankle centre = origin)."""

    heel: Floats
    toe: Floats
    forefoot: Floats
    rocker_centre: Floats
    rocker_radius: float

    @classmethod
    def of(cls, walker: Walker) -> Sole:
        """The sole of a walker's foot."""
        a = walker.anatomy
        tip = -a.ankle_height + (a.toe - a.rocker_start) ** 2 / (2.0 * a.rocker_radius)
        return cls(
            heel=np.array([-a.heel, -a.ankle_height, 0.0]),
            toe=np.array([a.toe, tip, 0.0]),
            forefoot=np.array([a.rocker_start, -a.ankle_height, 0.0]),
            rocker_centre=np.array([a.rocker_start, -a.ankle_height + a.rocker_radius, 0.0]),
            rocker_radius=a.rocker_radius,
        )

    def lowest(self, ankle: Floats, q: Floats, pitch: Floats) -> Floats:
        """Height (n,) in m of the lowest sole point: heel, toe tip and, toes down, the rolling forefoot."""
        heel = ankle[:, 2] + rotate(q, self.heel)[:, 2]
        toe = ankle[:, 2] + rotate(q, self.toe)[:, 2]
        rolling = ankle[:, 2] + rotate(q, self.rocker_centre)[:, 2] - self.rocker_radius
        return np.minimum(np.minimum(heel, toe), np.where(pitch < 0.0, rolling, np.inf))


@dataclass(frozen=True, eq=False)
class StanceFoot:
    """Position of one foot during floor contact, with extrapolation past both ends."""

    walker: Walker
    side: Side
    prints: tuple[Footprint, ...]
    timing: FootTiming
    sole: Sole

    @classmethod
    def of(cls, plan: Plan, walker: Walker, side: Side, timing: FootTiming) -> StanceFoot:
        """The stance foot of one side."""
        return cls(walker, side, plan.footprints[side], timing, Sole.of(walker))

    def landing_pitch(self, i: int) -> float:
        """Pitch in rad at the contact of footprint i."""
        foot = self.prints[i]
        target_rad = self.walker.sides[self.side].contact_pitch_rad + foot.pitch_rad
        return target_rad * self.walker.landing_amplitude(foot.step_m)

    def push_off_pitch(self, i: int, t: Floats) -> Floats:
        """Pitch (n,) in rad on footprint i from heel-off on (0 before), extrapolated past release."""
        heel_off, release = self.timing.heel_off[i], self.timing.release[i]
        phase_0 = self.walker.sides[self.side].heel_off
        u = (t - heel_off) / (release - heel_off)
        # the power makes the other foot's contact fall on phase one half
        share = np.clip((self.timing.opposite[i] - heel_off) / (release - heel_off), 0.2, 0.9)
        power = np.log((0.5 - phase_0) / (RELEASE_PHASE - phase_0)) / np.log(share)
        phase = phase_0 + (RELEASE_PHASE - phase_0) * np.clip(u, 1e-9, 3.0) ** power
        # long steps push off more: with the factor held at 1 the knee lands bent 14° at steps of 0.72 m;
        # the step that counts is the other foot's, which this foot trails: of a limping person's two
        # lengths its own next one would leave the heel too low for a long step and too high for a short one
        gait = self.walker.sides[self.side]
        other_side = self.walker.sides["left" if self.side == "right" else "right"]
        step_m = self.prints[i + 1].step_m * (other_side.length_factor / gait.length_factor)
        push = gait.push * self.walker.amplitude(step_m)
        rise = FOOT_PITCH(phase) - FOOT_PITCH(np.asarray(phase_0))
        return np.where(u > 0.0, push * rise * smoothstep(u / 0.45), 0.0)

    def on_heel(self, i: int, q: Floats) -> Floats:
        """Ankle (n, 3) in m with the heel point fixed at footprint i."""
        return self._floor_point(i, self.sole.heel) - rotate(q, self.sole.heel)

    def on_forefoot(self, i: int, q: Floats, pitch: Floats) -> Floats:
        """Ankle (n, 3) in m with the forefoot of footprint i rolling by −pitch without slip (pitch ≤ 0)."""
        heading, radius = self.prints[i].foot_rad, self.sole.rocker_radius
        centre = np.stack(
            (
                -radius * np.cos(heading) * pitch,
                -radius * np.sin(heading) * pitch,
                np.full(len(pitch), radius),
            ),
            axis=-1,
        )
        ankle = self._floor_point(i, self.sole.forefoot) + centre - rotate(q, self.sole.rocker_centre)
        return np.asarray(ankle)

    def on_landing(self, i: int, q: Floats, pitch: Floats) -> Floats:
        """Ankle (n, 3) in m landing on footprint i: over the heel, or the forefoot if it lands first."""
        return self.on_heel(i, q) if self.landing_pitch(i) >= 0.0 else self.on_forefoot(i, q, pitch)

    def path(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Ankle (n, 3), pitch (n,) and heading (n,) over the whole recording; only contact times are
        meaningful.

        Each footprint fills the samples from the middle of the previous swing to the middle of the next,
        extrapolated as if the foot still (or already) touched the floor.
        """
        timing, n = self.timing, len(t)
        ankle, pitch, heading = np.empty((n, 3)), np.zeros(n), np.empty(n)
        middles = np.searchsorted(t, 0.5 * (timing.release + timing.contact))
        bounds = [0, *middles.tolist(), n]
        for i, foot in enumerate(self.prints):
            part = slice(bounds[i], bounds[i + 1])
            times = t[part]
            angle = np.zeros(len(times))
            landing = np.zeros(len(times), bool)
            if i:
                contact, flat = timing.contact[i - 1], timing.flat[i - 1]
                landing = times < flat
                angle += self.landing_pitch(i) * (1.0 - smoothstep((times - contact) / (flat - contact)))
            if i < len(timing.release):
                angle += self.push_off_pitch(i, times)
            q = foot_orientation(foot.foot_rad, angle)
            early = self.on_landing(i, q, angle) if i else np.empty((len(times), 3))
            ankle[part] = np.where(landing[:, None], early, self.on_forefoot(i, q, angle))
            pitch[part] = angle
            heading[part] = foot.foot_rad
        return ankle, pitch, heading

    def _floor_point(self, i: int, point: Floats) -> Floats:
        """World position (3,) of a sole point with the foot flat on footprint i."""
        foot = self.prints[i]
        q = foot_orientation(foot.foot_rad, np.zeros(1))[0]
        return np.array([foot.x_m, foot.y_m, self.walker.anatomy.ankle_height]) + rotate(q, point)
