"""Soft tissue under a sensor: thigh and shank sensors rotate and shift slightly as hip and knee flex.

A deterministic function of the joint angles, zero in standing (docs/science/simulation.md, "Soft tissue"; its
amplitude is an assumption, real artefacts differ between people and locations).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from typing import Final

import numpy as np

from sagittal.core.frames import SHANK, SIDES, THIGH, Floats, Segment, Side
from sagittal.core.rotation import conjugate, exp, multiply, to_matrix
from sagittal.core.simulate.walker import SIGN

SHANK_SHARE: Final = 0.6
"""Rotation of a shank sensor relative to a thigh sensor's; there is less muscle under it."""


@dataclass(frozen=True)
class SoftTissue:
    """Amplitude of the artefact at 90° of knee flexion.

    Parameters
    ----------
    turn_rad : rotation, mostly about the segment's long axis. shift_m : sliding.
    """

    turn_rad: float = radians(3.0)
    shift_m: float = 0.010


def skin_motion(
    bones: Mapping[Segment, Floats], segment: Segment, tissue: SoftTissue
) -> tuple[Floats, Floats] | None:
    """Rotation (n, 4) and shift (n, 3) in m of the skin in segment axes; None for a rigid segment.

    Parameters
    ----------
    bones : segment → (n, 4) orientations of the pelvis and the leg, starting in standing.
    """
    side = next((s for s in SIDES if segment in (THIGH[s], SHANK[s])), None)
    if side is None:
        return None
    knee, hip = _flexions(bones, side)
    bend = np.sin(knee)
    turn = np.stack((0.4 * bend, bend - 0.3 * hip, 0.5 * bend), axis=-1)
    shift = np.stack((bend, 0.7 * bend, 0.3 * hip), axis=-1)
    # a left leg is the mirror image of a right one: rotations about x and y and shifts along z change sign
    mirror = SIGN[side]
    turn, shift = turn * [mirror, mirror, 1.0], shift * [1.0, 1.0, mirror]
    share = SHANK_SHARE if segment == SHANK[side] else 1.0
    # measured from standing, so that the mount stays what it is there
    return exp(share * tissue.turn_rad * (turn - turn[0])), tissue.shift_m * (shift - shift[0])


def _flexions(bones: Mapping[Segment, Floats], side: Side) -> tuple[Floats, Floats]:
    """Knee and hip flexion (n,) in rad."""
    thigh = bones[THIGH[side]]
    knee = multiply(conjugate(thigh), bones[SHANK[side]])
    hip = to_matrix(multiply(conjugate(bones["pelvis"]), thigh))
    # the knee is a hinge about z, turned backwards in flexion
    return 2.0 * np.arctan2(-knee[:, 3], knee[:, 0]), np.arctan2(-hip[:, 0, 1], hip[:, 1, 1])
