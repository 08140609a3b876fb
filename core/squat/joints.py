"""Joint angles of a kinematic chain under the names of core/angles."""

from __future__ import annotations

from typing import Final

import numpy as np

from sagittal.core.angles import SIGNS, cardan_zxy
from sagittal.core.frames import SUFFIX, Floats, Side
from sagittal.core.rotation import about, multiply

JOINTS: Final = (
    "ankle_rotation", "ankle_inversion", "ankle_dorsiflexion", "knee_flexion", "hip_flexion", "hip_adduction",
    "hip_rotation",
)  # fmt: skip
"""The seven angles in the order of Kianifar's tables 2 and 3: ankle IR/ER, Abd/Add, Flex/Ext, knee, then the
hip, there Flex/Ext first."""


def name_joint_angles(angles: Floats, side: Side) -> dict[str, Floats]:
    """Anatomical angles (n,) in rad, not relative to standing, by name with the suffix of the side.

    Ankle and knee are the chain's own joints with the sign of distal relative to proximal; the hip rotates
    about its axes in a different order than core/angles (docs/science/squat.md, "Angles").

    Parameters
    ----------
    angles : (n, 7) of the chain.
    """
    hip = multiply(multiply(about(1, -angles[:, 6]), about(0, -angles[:, 5])), about(2, -angles[:, 4]))
    about_axes = {
        "ankle": -angles[:, [2, 1, 0]],
        "knee": -angles[:, [3]],
        "hip": cardan_zxy(hip),
    }
    named = {}
    for joint, values in about_axes.items():
        for (name, right, left), column in zip(SIGNS[joint], values.T, strict=False):
            named[f"{name}_{SUFFIX[side]}"] = np.ascontiguousarray(
                (right if side == "right" else left) * column
            )
    return named
