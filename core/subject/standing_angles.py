"""Goniometer angles in quiet standing: the offset between our zero and the anatomical zero.

The calibration defines the person's own standing posture as zero (docs/science/joint-angles.md, "Zero"). If a
person stands with 10° of knee flexion, every knee angle is 10° too small compared with references until this
value is entered.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from sagittal.core.errors import ParameterError
from sagittal.core.message import Message

PELVIS: Final = ("pelvis_tilt", "pelvis_obliquity")
"""Pelvis angles that standing has a zero for; obliquity is given with the right side up positive."""

JOINTS: Final = (
    "hip_flexion", "hip_adduction", "hip_rotation", "knee_flexion", "knee_adduction", "knee_rotation",
    "ankle_dorsiflexion", "ankle_inversion", "ankle_rotation",
)  # fmt: skip
"""Joint angles, each with _l and _r."""

NAMES: Final = (*PELVIS, *(f"{joint}_{suffix}" for joint in JOINTS for suffix in "lr"))
"""Angles that may be entered, named and signed as in `sagittal.core.angles.JointAngles`."""

LIMIT_DEG: Final = 60.0
"""Nobody stands quietly with a larger angle; catches slips of the keyboard."""


def check_standing(standing_deg: Mapping[str, float]) -> None:
    """Reject unknown angle names and implausible standing angles.

    Raises
    ------
    ParameterError `unknown_angle`, `standing_angle_implausible`.
    """
    for name, value in standing_deg.items():
        if name not in NAMES:
            names_text = ", ".join(NAMES)
            raise ParameterError(
                "unknown_angle",
                Message("'{name}' is no angle; expected one of {known}.", name=name, known=names_text),
            )
        if not abs(value) <= LIMIT_DEG:
            raise ParameterError(
                "standing_angle_implausible",
                Message(
                    "{name}: {value:g}° in standing is outside ±{LIMIT_DEG:g}°; give what the "
                    "goniometer read, in degrees.",
                    name=name,
                    value=value,
                    LIMIT_DEG=LIMIT_DEG,
                ),
            )
