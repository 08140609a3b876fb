"""Joints with sensors on both segments."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final, Literal

from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Segment

JointKind = Literal["hip", "knee", "ankle"]

LEG_JOINTS: Final[Mapping[tuple[Segment, Segment], JointKind]] = {
    **{("pelvis", THIGH[side]): "hip" for side in SIDES},
    **{(THIGH[side], SHANK[side]): "knee" for side in SIDES},
    **{(SHANK[side], FOOT[side]): "ankle" for side in SIDES},
}
"""The sensors on either side of a joint, proximal first → the joint."""

CHAINS: Final[tuple[tuple[Segment, ...], ...]] = tuple(
    chain for side in SIDES for chain in ((SHANK[side], FOOT[side]), (THIGH[side], SHANK[side], FOOT[side]))
)
"""Sensors below one joint that may share a wrong clock: only that joint speaks against them."""


def list_worn_joints(segments: Iterable[Segment]) -> tuple[tuple[Segment, Segment], ...]:
    """Joints with sensors on both segments."""
    instrumented = set(segments)
    return tuple(joint for joint in LEG_JOINTS if instrumented.issuperset(joint))
