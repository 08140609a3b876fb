"""How far sensors and joints may be from where they usually are, and how far what is measured is believed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import radians

from sagittal.core.agreement.joints import JointKind
from sagittal.core.agreement.params import JointBandParams


@dataclass(frozen=True)
class ArmParams:
    """How far places and centres may be from the nominal ones, and how far what is measured is believed.

    Parameters
    ----------
    place_sd : kind of segment → (3,) of the sensor's place along its axes, m. centre_sd : joint → (3,) of its
        centre in the proximal segment, m. wander_sd : kind of segment → how far a joint wanders in the
        sensor's axes for one radian of flexion, m/rad. turn_sd : of the turn between both sensors' headings,
        rad. noise_mps2 : least spread of the difference.
    stride_s : the whole walk counts as so much independent evidence. longest_s : so much walking is looked
        at. least_s : with less a joint says nothing. worst_misfit : of a joint's acceleration over its size,
        above which it says nothing. joints : which part of accelerations is compared.
    """

    place_sd: Mapping[str, tuple[float, float, float]] = field(
        default_factory=lambda: {
            "pelvis": (0.03, 0.04, 0.02),
            "thigh": (0.03, 0.06, 0.03),
            "shank": (0.02, 0.05, 0.03),
            "foot": (0.02, 0.02, 0.015),
        }
    )
    centre_sd: Mapping[JointKind, tuple[float, float, float]] = field(
        default_factory=lambda: {
            "hip": (0.01, 0.01, 0.01),
            "knee": (0.02, 0.015, 0.01),
            "ankle": (0.02, 0.015, 0.01),
        }
    )
    wander_sd: Mapping[str, float] = field(
        default_factory=lambda: {"thigh": 0.02, "shank": 0.01, "foot": 0.005}
    )
    turn_sd: float = radians(8.0)
    ahead_sd: float = radians(20.0)
    noise_mps2: float = 0.05
    stride_s: float = 1.1
    longest_s: float = 30.0
    least_s: float = 3.0
    worst_misfit: float = 0.9
    joints: JointBandParams = field(default_factory=JointBandParams)
