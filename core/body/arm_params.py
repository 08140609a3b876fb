"""Prior uncertainty of sensor positions and joint centres, and reliability of their measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import radians

from sagittal.core.agreement.joints import JointKind
from sagittal.core.agreement.params import JointBandParams


@dataclass(frozen=True)
class ArmParams:
    """Prior uncertainty of sensor positions and joint centres, and reliability of their measurement.

    Parameters
    ----------
    place_sd : kind of segment → (3,) of the sensor position along its axes, m. centre_sd : joint → (3,) of
        its centre in the proximal segment, m. wander_sd : kind of segment → apparent movement of the joint in
        sensor axes per radian of flexion, m/rad. turn_sd : of the relative heading of the two sensors, rad.
        noise_mps2 : minimum spread of the difference.
    stride_s : duration of independent evidence assigned to the whole walk. longest_s : maximum duration of
        walking used. least_s : minimum duration for a joint. worst_misfit : maximum misfit relative to the
        joint acceleration. joints : frequency band of the comparison.
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
