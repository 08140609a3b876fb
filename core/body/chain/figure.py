"""Combination of the two leg chains: common pelvis and stick figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from sagittal.core.body.chain.leg import LegMotion
from sagittal.core.body.estimate import PoseEstimate
from sagittal.core.body.kinematics import forward_kinematics, nominal_body
from sagittal.core.estimators import AUTO, SQUAT_CHAIN
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Bools, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations

HAND_OVER_S: Final = 0.5
"""In this time the pelvis passes from one leg's chain to the other's (our choice, for the eye)."""


def join_legs(legs: Mapping[Side, LegMotion]) -> Orientations:
    """Segments of all legs, with the pelvis from the supporting leg, or the mean in double support.

    Each leg's chain estimates the pelvis separately; the estimates differ by the drift about the vertical.
    """
    chains = [legs[side].orientations for side in SIDES if side in legs]
    if len(chains) == 1:
        return chains[0]
    first = chains[0]
    q: dict[Segment, Floats] = {}
    valid: dict[Segment, Bools] = {}
    for chain in chains:
        q |= {s: x for s, x in chain.q.items() if s != "pelvis"}
        valid |= {s: x for s, x in chain.valid.items() if s != "pelvis"}
    q["pelvis"], valid["pelvis"] = _share_pelvis(list(legs.values()), first.rate_hz)
    return replace(first, q=q, valid=valid)


def _share_pelvis(legs: list[LegMotion], rate_hz: float) -> tuple[Floats, Bools]:
    from scipy.ndimage import uniform_filter1d

    width = max(1, round(HAND_OVER_S * rate_hz))
    lead = legs[0].orientations.q["pelvis"]
    total, is_known = np.zeros_like(lead), np.zeros(len(lead), bool)
    for leg in legs:
        own, available = leg.orientations.q["pelvis"], leg.orientations.valid["pelvis"]
        weight = uniform_filter1d(leg.stands.astype(float), width, mode="nearest") * available
        same_half = np.where((own * lead).sum(axis=1) < 0.0, -1.0, 1.0)
        total += (weight * same_half)[:, None] * own
        is_known |= weight > 0.0
    norm = np.linalg.norm(total, axis=1)
    is_known &= norm > 0.0
    return np.where(is_known[:, None], total / np.where(is_known, norm, 1.0)[:, None], lead), is_known


def draw_legs(legs: Mapping[Side, LegMotion], height_m: float | None) -> PoseEstimate:
    """Poses with the supporting feet on the floor; a lifted foot, which is not measured, is drawn at a right
    angle to the shank.

    Parameters
    ----------
    height_m : of the body, None = nominal.
    """
    joined = join_legs(legs)
    q, valid = dict(joined.q), dict(joined.valid)
    for side, leg in legs.items():
        foot, shank, thigh = FOOT[side], SHANK[side], THIGH[side]
        q[foot] = np.where(leg.stands[:, None], q[foot], q[shank])
        valid[foot] = valid[shank]
        valid[thigh] = valid[thigh] & valid[shank]
    contacts = {side: leg.stands for side, leg in legs.items()}
    figure = replace(joined, q=q, valid=valid)
    poses = forward_kinematics(figure, nominal_body(height_m)[0], contacts)
    settings = {"requested": AUTO, "sensors": tuple(s for s in valid if s in (SQUAT_CHAIN.sensors or ()))}
    return PoseEstimate(
        joined, replace(poses, method=SQUAT_CHAIN.method, notices=(), diagnostics=settings), None
    )
