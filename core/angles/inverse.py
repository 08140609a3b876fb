"""Joint angles → segment orientations: the inverse of sagittal.core.angles.

R_distal = R_proximal Rz(a) Rx(b) Ry(c) down the leg, R_pelvis = R_neutral Ry(rotation) Rx(b) Rz(tilt), with
the signs of sagittal.core.angles. Angles over a cycle have names without side, as in the curves of
sagittal.core.parameters and sagittal.core.norms: positive with that side up and that side forward.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from sagittal.core.angles import SIGNS, list_leg_joints
from sagittal.core.frames import R_NEUTRAL, Floats, Segment, Side
from sagittal.core.rotation import about, from_matrix, multiply

_NEUTRAL: Final = from_matrix(R_NEUTRAL)


def pelvis_orientation(angles: Mapping[str, Floats], side: Side) -> Floats:
    """Pelvis (n, 4) of a person walking along x, from the pelvis angles over the cycle of one side.

    Parameters
    ----------
    angles : "pelvis_tilt", "pelvis_obliquity", "pelvis_rotation" → (n,) rad; missing angles are 0.
    """
    own = 1.0 if side == "right" else -1.0
    tilt, obliquity, turned = (
        np.asarray(angles.get(f"pelvis_{name}", 0.0)) for name in ("tilt", "obliquity", "rotation")
    )
    turned, obliquity, tilt = np.broadcast_arrays(own * turned, -own * obliquity, -tilt)
    return multiply(_NEUTRAL, multiply(multiply(about(1, turned), about(0, obliquity)), about(2, tilt)))


def leg_orientations(angles: Mapping[str, Floats], side: Side) -> dict[Segment, Floats]:
    """Thigh, shank and foot (n, 4) in pelvis axes.

    Parameters
    ----------
    angles : "hip_flexion" … "ankle_rotation" → (n,) rad; missing angles are 0.
    """
    orientations: dict[Segment, Floats] = {}
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for joint, _, distal in list_leg_joints(side):
        a, b, c = np.broadcast_arrays(
            *(
                (right if side == "right" else left) * np.asarray(angles.get(name, 0.0))
                for name, right, left in SIGNS[joint]
            )
        )
        q = multiply(q, multiply(multiply(about(2, a), about(0, b)), about(1, c)))
        orientations[distal] = q
    return orientations
