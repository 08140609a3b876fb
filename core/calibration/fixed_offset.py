"""Fixed offset: sensors attached as specified by the protocol, so that their alignment is known without
movement.

Kianifar et al.: x of the device along the bone towards the trunk, y away from the body. On the front of the
thigh and on the back y is in the sagittal plane, on the flat side of the shin 45° inward of it.
"""

from __future__ import annotations

from math import radians
from typing import Final

import numpy as np

from sagittal.core.frames import SHANK, THIGH, Floats, Segment, Side
from sagittal.core.rotation import about, to_matrix

SHIN_FACE: Final = radians(45.0)
"""The flat side of the shin looks so far inward of forward (Kianifar, "IMU orientations")."""

FRONT: Final[Floats] = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Sensor to segment of a device on the front: x → up, y → forward, z → left."""
BACK: Final[Floats] = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Of one on the back: x → up, y → backward, z → right."""
FRONT.setflags(write=False)
BACK.setflags(write=False)


def make_fixed_mounts(*sides: Side) -> dict[Segment, Floats]:
    """Segment → (3, 3) R_segment_sensor for the pelvis and for shank and thigh of the squatting legs."""
    mounts: dict[Segment, Floats] = {}
    for side in sides:
        inward = SHIN_FACE if side == "right" else -SHIN_FACE
        mounts |= {SHANK[side]: to_matrix(about(1, inward)) @ FRONT, THIGH[side]: FRONT.copy()}
    return {**mounts, "pelvis": BACK.copy()}
