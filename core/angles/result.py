"""Joint angles of a recording: names, signs and metadata."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from sagittal.core.errors import Notice
from sagittal.core.frames import FOOT, SHANK, THIGH, Floats, Posture, Segment, Side

SIGNS: Final[dict[str, tuple[tuple[str, float, float], ...]]] = {
    "hip": (("hip_flexion", 1, 1), ("hip_adduction", 1, -1), ("hip_rotation", 1, -1)),
    "knee": (("knee_flexion", -1, -1), ("knee_adduction", 1, -1), ("knee_rotation", 1, -1)),
    "ankle": (("ankle_dorsiflexion", 1, 1), ("ankle_inversion", 1, -1), ("ankle_rotation", 1, -1)),
}
"""Joint → (name, sign right, sign left) of a, b, c.

Positive: flexion, dorsiflexion; adduction, varus, inversion; internal rotation.
"""


def list_leg_joints(side: Side) -> tuple[tuple[str, Segment, Segment], ...]:
    """Joints of one leg as (joint, proximal segment, distal segment)."""
    return (
        ("hip", "pelvis", THIGH[side]),
        ("knee", THIGH[side], SHANK[side]),
        ("ankle", SHANK[side], FOOT[side]),
    )


@dataclass(frozen=True, eq=False)
class JointAngles:
    """Joint angles in rad on the uniform axis; NaN where a segment was lost.

    Parameters
    ----------
    angles : name → (n,), names as in the exports without the unit: "pelvis_tilt", "pelvis_obliquity",
        "hip_flexion_l", "hip_adduction_l", "hip_rotation_l", "knee_flexion_l", "knee_adduction_l",
        "knee_rotation_l", "ankle_dorsiflexion_l", "ankle_inversion_l", "ankle_rotation_l", right alike.
        Pelvis tilt: anterior positive. Pelvis obliquity: right side up is positive.
        Zero is the mean over the calibration's zero window.
    zero_offset : name → rad, the subtracted value (the raw standing angle).
    zero : "standing", or "walking": there was no quiet standing and angles are relative to their mean over
    straight walking, so their shape and range are meaningful but not their level.
    standing_deg : goniometer angles in that posture, if entered; see
        `sagittal.core.subject.standing_angles`, and `sagittal.core.parameters.anatomical_zero`, which adds
        them back.
    headings : "pelvis", "foot_l", "foot_r" → (n,) rad about the vertical, left positive, unwrapped, with an
    arbitrary zero; only for segments with a sensor. Only changes within a stride are meaningful.
    withheld : suppressed angles → reason (`sagittal.core.angles.withheld`).
    bounds : name → rad, the straight knee of a leg model: at this value the angle is a model limit, not a
    measurement.
    """

    t_s: Floats
    angles: Mapping[str, Floats]
    zero_offset: Mapping[str, float]
    zero: Posture = "standing"
    notices: tuple[Notice, ...] = ()
    diagnostics: Mapping[str, object] = field(default_factory=dict)
    standing_deg: Mapping[str, float] = field(default_factory=dict)
    headings: Mapping[str, Floats] = field(default_factory=dict)
    withheld: Mapping[str, str] = field(default_factory=dict)
    bounds: Mapping[str, float] = field(default_factory=dict)

    @property
    def estimated(self) -> frozenset[str]:
        """Angles, with their side, that are not measured by two sensors."""
        names = self.diagnostics.get("estimated", ())
        return frozenset(str(name) for name in names) if isinstance(names, (tuple, list)) else frozenset()
