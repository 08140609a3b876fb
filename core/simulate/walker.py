"""The simulated person: body lengths and gait parameters, per side if sides may differ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import radians

import numpy as np

from sagittal.core.body.model import BodyModel
from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats, Side

REFERENCE_HEIGHT_M = 1.745
"""Height of the person the target curves were fitted for: leg and ankle height 0.925 m = 0.53 of body height
(Winter 2009, table 4.1)."""

SIGN: Mapping[Side, float] = {"right": 1.0, "left": -1.0}
"""Side of the body on the segment's z axis (right positive)."""


@dataclass(frozen=True)
class Anatomy:
    """Lengths in m; the sole is a heel point, a flat part and a rolling forefoot.

    Parameters
    ----------
    ankle_height : ankle centre above the sole. heel : distance of the heel point posterior to the ankle
        (positive).
    rocker_start : forward of the ankle, where the sole begins to curve up by `rocker_radius`. toe : tip.
    """

    hip_width: float = 0.17
    thigh: float = 0.42
    shank: float = 0.42
    ankle_height: float = 0.085
    heel: float = 0.055
    rocker_start: float = 0.12
    rocker_radius: float = 0.10
    toe: float = 0.18

    def scale_by(self, k: float) -> Anatomy:
        """The same shape, k times as large."""
        return Anatomy(**{name: k * length for name, length in vars(self).items()})

    def body_model(self) -> BodyModel:
        """These lengths as the body model of the analysis, marked as measured."""
        return BodyModel(
            hip_width=self.hip_width,
            thigh=self.thigh,
            shank=self.shank,
            ankle_height=self.ankle_height,
            foot=self.heel + self.toe,
            estimated=False,
        )


@dataclass(frozen=True)
class SideGait:
    """Gait of one leg; phases are fractions of its own stride (docs/science/simulation.md, "Timing", "Target
    curves").

    Parameters
    ----------
    double_support : opposite contact to own release. flat_from : foot flat after own contact.
    heel_off : phase at which the heel rises. toe_out_rad : foot heading outward of the path.
    contact_pitch_rad : toes up at contact; below 0 the forefoot lands first. push : factor on the foot's
        pitch at push-off. knee_min_rad : minimum knee flexion.
    clearance_m : height of the sole at mid-swing.
    length_factor, time_factor : of this leg's steps.
    knee_stance_rad, knee_swing_rad : added flexion outside swing; commanded peak in swing, None = healthy.
    knee_wave : fraction of the flexion wave at loading. hip_factor, ankle_factor : on the target curves.
    hip_swing_rad, ankle_swing_rad : added flexion and dorsiflexion in swing.
    circumduction_rad, hike_rad : added hip abduction, and rise of this side of the pelvis, in swing.
    trailing_factor : on the distance of the pelvis in front of the midpoint of the feet when this foot
        trails. A foot with weak push-off keeps its heel low, and its leg does not extend as far back.

    These are inputs, not results: lifts for clearance and the contact paths at both ends modify them.
    """

    double_support: float = 0.0928
    flat_from: float = 0.0985
    heel_off: float = 0.3149
    toe_out_rad: float = radians(9.0)
    contact_pitch_rad: float = radians(16.12)
    knee_min_rad: float = radians(3.5)
    clearance_m: float = 0.008
    length_factor: float = 1.0
    time_factor: float = 1.0
    push: float = 1.0
    knee_stance_rad: float = 0.0
    knee_wave: float = 1.0
    knee_swing_rad: float | None = None
    hip_swing_rad: float = 0.0
    hip_factor: float = 1.0
    ankle_swing_rad: float = 0.0
    ankle_factor: float = 1.0
    circumduction_rad: float = 0.0
    hike_rad: float = 0.0
    trailing_factor: float = 1.0


@dataclass(frozen=True)
class Variability:
    """Step-to-step standard deviations; time and length relative (docs/science/simulation.md,
    "Footprints").
    """

    step_time: float = 0.012
    step_length: float = 0.027
    width_m: float = 0.008
    knee_rad: float = radians(2.0)
    pitch_rad: float = radians(1.5)
    hip_rad: float = radians(1.0)


STEADY = Variability(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Every step alike, for comparing mean curves."""


@dataclass(frozen=True)
class Walker:
    """Body and gait of one person.

    Parameters
    ----------
    width_m : between the two lines of footprints (ankle centres).
    forward_m, forward_wave_m : distance of the pelvis in front of the midpoint of the feet at contact; cos
        and sin of its double step wave. lateral : fraction of the stance foot's lateral offset by which the
        pelvis shifts towards it.
    standing_knee_rad : knee flexion at rest. tilt_rad : added anterior pelvic tilt.
    reference_step_m : step with amplitude 1; amplitude scales with step length to the power of
        `amplitude_power`.
    rotation_factor, obliquity_factor : on the pelvis curves.
    tibial_rotation_rad : internal rotation of the shank at 90° of knee flexion. lands_rising : the foot
        pitches up until it touches the floor. People differ in this, and event rules based on the largest
        pitch are early by up to 0.1 s without it (docs/science/simulation.md, "Swing foot").
    impact : strength of foot contact, 1 = typical at 1.2 m/s. tremor_rad, tremor_hz : amplitude of a
        permanent tremor of the feet, and its frequency.
    """

    height_m: float = REFERENCE_HEIGHT_M
    anatomy: Anatomy = Anatomy()
    sides: Mapping[Side, SideGait] = field(default_factory=lambda: {"left": SideGait(), "right": SideGait()})
    width_m: float = 0.10
    forward_m: float = 0.0485
    forward_wave_m: tuple[float, float] = (0.0026, -0.0019)
    lateral: float = 0.45
    standing_knee_rad: float = radians(5.0)
    tilt_rad: float = 0.0
    reference_step_m: float = 0.641
    amplitude_power: float = 0.5
    rotation_factor: float = 1.0
    obliquity_factor: float = 1.0
    tibial_rotation_rad: float = 0.0
    lands_rising: bool = True
    impact: float = 1.0
    tremor_rad: float = 0.0
    tremor_hz: float = 5.0
    variability: Variability = Variability()

    @classmethod
    def of_height(cls, height_m: float, variability: Variability | None = None) -> Walker:
        """A healthy person of this height, see `scaled_to`."""
        base = cls()
        return replace(base, variability=variability or base.variability).scaled_to(height_m)

    def scaled_to(self, height_m: float) -> Walker:
        """The geometrically similar person of another height; all lengths scale alike.

        Raises
        ------
        ParameterError : "height_implausible" outside 1.0 to 2.3 m.
        """
        if not 1.0 <= height_m <= 2.3:
            raise ParameterError(
                "height_implausible",
                f"Height {height_m:g} m is outside the 1.0 to 2.3 m this walker can have.",
            )
        k = height_m / self.height_m
        return replace(
            self,
            height_m=height_m,
            anatomy=self.anatomy.scale_by(k),
            sides={s: replace(g, clearance_m=k * g.clearance_m) for s, g in self.sides.items()},
            width_m=k * self.width_m,
            forward_m=k * self.forward_m,
            forward_wave_m=(k * self.forward_wave_m[0], k * self.forward_wave_m[1]),
            reference_step_m=k * self.reference_step_m,
            variability=replace(self.variability, width_m=k * self.variability.width_m),
        )

    @property
    def scale(self) -> float:
        """Size relative to the reference person of the curves."""
        return self.height_m / REFERENCE_HEIGHT_M

    def amplitude(self, step_m: float) -> float:
        """Factor on the angle curves for a step of this length; steps on the spot keep a lifted knee."""
        if step_m <= 0.05 * self.scale:
            return 0.35
        return min(1.15, float((step_m / self.reference_step_m) ** self.amplitude_power))

    def landing_amplitude(self, step_m: float) -> float:
        """Factor on the pitch at contact; short and closing steps land flat."""
        if step_m <= 0.3 * self.reference_step_m:
            return 0.15
        return min(1.0, float((step_m / self.reference_step_m) ** self.amplitude_power))


def leg_reach(anatomy: Anatomy, knee_rad: Floats | float) -> Floats:
    """Hip to ankle distance in m at a knee flexion in rad."""
    a, b = anatomy.thigh, anatomy.shank
    return np.asarray(np.sqrt(a**2 + b**2 + 2.0 * a * b * np.cos(knee_rad)))
