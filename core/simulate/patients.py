"""Twelve simulated patients: deviations of each gait from the healthy reference (docs/science/simulation.md,
"Virtual people").

One body, plausible amplitudes, no clinical data: they show that the analysis detects and names a deviation,
never how well it performs on patients. If one side is affected it is the left. Parameters are inputs; the
resulting gait is documented and tested as signatures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import radians as deg
from types import MappingProxyType
from typing import Final

from sagittal.core.frames import Side
from sagittal.core.simulate.walker import SideGait, Variability, Walker


@dataclass(frozen=True)
class SimulatedPatient:
    """A person with the steps taken: length in m at the reference height, duration in s."""

    title: str
    step_m: float
    step_s: float
    walker: Walker


UNEVEN: Final = Variability(
    step_time=0.02,
    step_length=0.03,
    width_m=0.010,
    knee_rad=deg(2.5),
    pitch_rad=deg(1.5),
    hip_rad=deg(1.2),
)
"""Step-to-step variation after a stroke."""

PARKINSON_SPREAD: Final = replace(Variability(), step_time=0.03, step_length=0.06, width_m=0.006)

ELDERLY_SPREAD: Final = Variability(
    step_time=0.025,
    step_length=0.04,
    width_m=0.015,
    knee_rad=deg(2.5),
    pitch_rad=deg(2.0),
    hip_rad=deg(1.5),
)

HEALTHY: Final = SideGait()


def _both(gait: SideGait) -> dict[Side, SideGait]:
    return {"left": gait, "right": gait}


def _sides(left: SideGait, right: SideGait = HEALTHY) -> dict[Side, SideGait]:
    return {"left": left, "right": right}


SLOWLY: Final = Walker(sides=_both(SideGait(double_support=0.105, knee_wave=0.5)))
"""A healthy person who takes their time: both feet are on the floor longer, and the knee gives less."""

QUICKLY: Final = Walker(sides=_both(SideGait(knee_swing_rad=deg(64.0))))
"""A healthy person in a hurry: the knee swings through more bent."""

HEMIPARETIC: Final = Walker(
    variability=UNEVEN,
    width_m=0.15,
    rotation_factor=0.9,
    sides=_sides(
        left=SideGait(
            length_factor=1.12,
            time_factor=1.16,
            double_support=0.17,
            contact_pitch_rad=deg(-3.0),
            push=0.68,
            knee_swing_rad=deg(32.0),
            circumduction_rad=deg(3.0),
            hike_rad=deg(7.0),
            ankle_swing_rad=deg(-2.0),
            hip_factor=0.8,
            knee_stance_rad=deg(2.0),
            clearance_m=-0.004,
            toe_out_rad=deg(14.0),
        ),
        right=SideGait(
            length_factor=0.88,
            time_factor=0.84,
            double_support=0.15,
            contact_pitch_rad=deg(14.0),
            knee_wave=0.5,
            knee_swing_rad=deg(68.0),
            ankle_swing_rad=deg(-4.0),
        ),
    ),
)

HEMI_MILD: Final = Walker(
    variability=UNEVEN,
    width_m=0.13,
    sides=_sides(
        left=SideGait(
            length_factor=1.05,
            time_factor=1.07,
            double_support=0.135,
            contact_pitch_rad=deg(5.0),
            push=0.84,
            knee_swing_rad=deg(50.0),
            circumduction_rad=deg(3.0),
            hike_rad=deg(2.5),
            ankle_swing_rad=deg(-3.0),
            trailing_factor=0.5,
        ),
        right=SideGait(
            length_factor=0.95,
            time_factor=0.93,
            double_support=0.125,
            knee_swing_rad=deg(68.0),
            trailing_factor=1.2,
        ),
    ),
)

STIFF_KNEE: Final = Walker(
    sides=_sides(
        SideGait(
            knee_swing_rad=deg(28.0),
            hip_swing_rad=deg(-6.0),
            ankle_swing_rad=deg(-12.0),
            circumduction_rad=deg(2.5),
            hike_rad=deg(4.0),
            push=0.65,
            trailing_factor=0.4,
        )
    )
)

DROP_FOOT: Final = Walker(
    sides=_sides(
        SideGait(
            ankle_swing_rad=deg(-18.0),
            contact_pitch_rad=deg(-8.0),
            hip_swing_rad=deg(12.0),
            knee_swing_rad=deg(72.0),
            flat_from=0.09,
            clearance_m=0.012,
        )
    )
)

CROUCH: Final = Walker(
    standing_knee_rad=deg(24.0),
    tilt_rad=deg(4.0),
    sides=_both(
        SideGait(
            knee_stance_rad=deg(24.0),
            knee_wave=0.4,
            knee_swing_rad=deg(68.0),
            contact_pitch_rad=deg(4.0),
            ankle_swing_rad=deg(3.0),
            push=0.8,
        )
    ),
)

ANTALGIC: Final = Walker(
    impact=0.7,
    sides=_sides(
        left=SideGait(
            length_factor=1.10,
            time_factor=1.15,
            double_support=0.14,
            push=0.83,
            contact_pitch_rad=deg(10.0),
            knee_swing_rad=deg(63.0),
            ankle_swing_rad=deg(-8.0),
        ),
        right=SideGait(
            length_factor=0.90,
            time_factor=0.85,
            double_support=0.11,
            knee_swing_rad=deg(69.0),
            ankle_swing_rad=deg(-6.0),
        ),
    ),
)

_PARKINSON_LEG: Final = SideGait(
    contact_pitch_rad=deg(3.0),
    push=0.55,
    knee_stance_rad=deg(10.0),
    knee_swing_rad=deg(44.0),
    hip_factor=0.8,
    ankle_swing_rad=deg(-16.0),
    clearance_m=0.003,
    double_support=0.14,
    flat_from=0.08,
    heel_off=0.36,
    toe_out_rad=deg(6.0),
)

PARKINSON: Final = Walker(
    variability=PARKINSON_SPREAD,
    amplitude_power=0.55,
    width_m=0.09,
    rotation_factor=0.4,
    obliquity_factor=0.5,
    tilt_rad=deg(-4.0),
    standing_knee_rad=deg(15.0),
    impact=0.7,
    sides=_both(_PARKINSON_LEG),
)

SEVERE_SHUFFLE: Final = replace(
    PARKINSON,
    sides=_both(
        replace(
            _PARKINSON_LEG,
            contact_pitch_rad=0.0,
            push=0.22,
            knee_swing_rad=deg(30.0),
            ankle_swing_rad=0.0,
            clearance_m=0.002,
        )
    ),
)

STEP_ASYMMETRY: Final = Walker(
    sides=_sides(
        SideGait(length_factor=0.85, heel_off=0.26, knee_swing_rad=deg(65.0)),
        SideGait(length_factor=1.15),
    )
)

ELDERLY: Final = Walker(
    variability=ELDERLY_SPREAD,
    width_m=0.14,
    rotation_factor=0.8,
    impact=0.7,
    sides=_both(
        SideGait(
            double_support=0.15,
            contact_pitch_rad=deg(11.0),
            heel_off=0.34,
            push=0.98,
            knee_stance_rad=deg(1.0),
            knee_wave=0.2,
            knee_swing_rad=deg(66.0),
            hip_factor=0.9,
            ankle_swing_rad=deg(-6.0),
            clearance_m=0.010,
            trailing_factor=1.1,
        )
    ),
)

PATIENTS: Mapping[str, SimulatedPatient] = MappingProxyType(
    {
        "healthy": SimulatedPatient("Healthy person", 0.64, 0.54, Walker()),
        "healthy_slow": SimulatedPatient("Healthy person walking slowly", 0.48, 0.73, SLOWLY),
        "hemiparetic": SimulatedPatient("Left hemiparesis", 0.40, 0.72, HEMIPARETIC),
        "hemi_mild": SimulatedPatient("Mild left hemiparesis", 0.52, 0.60, HEMI_MILD),
        "stiff_knee": SimulatedPatient("Stiff left knee", 0.55, 0.60, STIFF_KNEE),
        "drop_foot": SimulatedPatient("Left drop foot", 0.55, 0.57, DROP_FOOT),
        "crouch": SimulatedPatient("Crouch gait", 0.48, 0.56, CROUCH),
        "antalgic": SimulatedPatient("Pain in the left leg", 0.52, 0.58, ANTALGIC),
        "parkinson": SimulatedPatient("Short quick steps", 0.27, 0.43, PARKINSON),
        "severe_shuffle": SimulatedPatient("Severe shuffling", 0.18, 0.45, SEVERE_SHUFFLE),
        "step_asym": SimulatedPatient("Steps of unequal length", 0.56, 0.56, STEP_ASYMMETRY),
        "elderly": SimulatedPatient("Cautious elderly person", 0.42, 0.66, ELDERLY),
    }
)
