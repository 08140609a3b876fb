"""Joint angles: one sequence, one sign table (spec/clinic.md §1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from core.errors import Notice
from core.frames import Floats


@dataclass(frozen=True, eq=False)
class JointAngles:
    """Joint angles in rad on the uniform axis; NaN where a segment was lost.

    Parameters
    ----------
    angles : name → (n,), names as in the exports without the unit: "pelvis_tilt", "pelvis_obliquity",
        "hip_flexion_l", "hip_adduction_l", "hip_rotation_l", "knee_flexion_l", "knee_adduction_l",
        "knee_rotation_l", "ankle_dorsiflexion_l", "ankle_inversion_l", "ankle_rotation_l", right alike.
        Zero is the mean over the calibration's standing window.
    zero_offset : name → rad that was subtracted (the raw standing angle).
    zero : "standing" (the only zero so far).
    """

    t_s: Floats
    angles: Mapping[str, Floats]
    zero_offset: Mapping[str, float]
    zero: str = "standing"
    notices: tuple[Notice, ...] = ()
    diagnostics: Mapping[str, object] = field(default_factory=dict)
