"""Reference walk defined by curves over the gait cycle, on the patient's body: the norm or the better side.

Both legs follow the same curves, each at its own phase. Everything independent of time is precomputed, so a
frame requires only a look-up, one rotation and the floor contact.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Final

import numpy as np

from sagittal.core import rotation
from sagittal.core.angles import SIGNS
from sagittal.core.angles.inverse import leg_orientations, pelvis_orientation
from sagittal.core.body.kinematics import leg_points, sole_points
from sagittal.core.body.model import BodyModel
from sagittal.core.frames import FOOT, SHANK, SIDES, SUFFIX, THIGH, Floats, Segment, Side
from sagittal.server.viewer.few_poses import find_matrices, turn_about_z
from sagittal.server.viewer.motion import LOWER_BODY

SAGITTAL: Final = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
"""Without these there is no walk to show."""

SEGMENTS: Final = LOWER_BODY
Phases = Mapping[Side, float | None]


class ReferenceWalk:
    """Poses of a reference at any phase.

    Parameters
    ----------
    curves : variable → (n,) rad over the cycle, signs as in the curves of sagittal.core.parameters; the
        sagittal ones are required, others default to 0. Pelvis rotation is relative to the heading.
    lead : side whose cycle determines the pelvis.
    """

    def __init__(self, curves: Mapping[str, Floats], body: BodyModel, lead: Side = "left") -> None:
        self.lead: Side = lead
        self._last = len(curves[SAGITTAL[0]]) - 1
        pelvis = np.broadcast_to(pelvis_orientation(curves, lead), (self._last + 1, 4))
        upright: dict[Segment, Floats] = {"pelvis": np.array([1.0, 0.0, 0.0, 0.0])}
        turn, points = [], []
        for side in SIDES:
            leg = leg_orientations(curves, side)
            hip, knee, ankle = leg_points({**upright, **leg}, body, side)
            sole = [ankle + rotation.rotate(leg[FOOT[side]], np.array(x)) for x in sole_points(body)]
            turn.append(np.stack([leg[s] for s in (THIGH[side], SHANK[side], FOOT[side])], axis=1))
            points.append(np.stack(np.broadcast_arrays(hip, knee, ankle, *sole), axis=1))
        self._pelvis = [(float(w), float(x), float(y), float(z)) for w, x, y, z in pelvis]
        # side → row → orientations (3, 4) of a leg, and its points (n, 3)
        self._turns, self._points = ([list(arrays) for arrays in pair] for pair in (turn, points))

    def at(self, phases: Phases, place: tuple[float, float], heading: float) -> tuple[Floats, Floats] | None:
        """Return orientations (7, 4) and positions (7, 3), m, of `SEGMENTS`, lower sole on the floor.

        Parameters
        ----------
        phases : side → 0 to 1; an unknown one is half a cycle from the other. None if both are unknown.
        place : position of the pelvis, m. heading : walking direction, rad.
        """
        left, right = (_row(phases, side, self._last) for side in SIDES)
        if left is None or right is None:
            return None
        return self.pose(left, right, place, heading)

    def pose(
        self, left: int, right: int, place: tuple[float, float], heading: float
    ) -> tuple[Floats, Floats]:
        """Like `at`, with the curve rows of the legs."""
        pelvis = turn_about_z(heading, self._pelvis[left if self.lead == "left" else right])
        q, p = np.empty((len(SEGMENTS), 4)), np.zeros((len(SEGMENTS), 3))
        q[0] = pelvis
        transform, matrix, lowest = _before(*pelvis), find_matrices(q[0]).T, inf
        for k, row in enumerate((left, right)):
            # pelvis ⊗ turn and R(pelvis) point, of a leg at once
            leg = slice(1 + 3 * k, 4 + 3 * k)
            np.matmul(self._turns[k][row], transform, out=q[leg])
            points = self._points[k][row] @ matrix
            p[leg] = points[:3]
            lowest = min(lowest, *points[:, 2].tolist())
        p += (*place, -lowest)
        return q, p


def _before(w: float, x: float, y: float, z: float) -> Floats:
    """Matrix (4, 4) with q ⊗ turn = turn @ matrix."""
    return np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])


def stand_upright(body: BodyModel) -> tuple[Floats, Floats]:
    """Return orientations (7, 4) and positions (7, 3), m, of `SEGMENTS` standing at the origin, facing x."""
    return ReferenceWalk({name: np.zeros(1) for name in SAGITTAL}, body).pose(0, 0, (0.0, 0.0), 0.0)


def _row(phases: Phases, side: Side, last: int) -> int | None:
    own = phases.get(side)
    if own is None:
        opposite = phases.get("right" if side == "left" else "left")
        if opposite is None:
            return None
        own = (opposite + 0.5) % 1.0
    return round(last * min(max(own, 0.0), 1.0))


def add_standing_angles(
    curves: Mapping[str, Floats], zero: Mapping[str, float], side: Side
) -> dict[str, Floats]:
    """Add the standing angles to the mean curves of a side, so that both legs can follow them.

    Parameters
    ----------
    curves : variable → (n,) rad relative to standing. zero : angle → rad in standing, as
        `JointAngles.zero_offset`.
    """
    own = 1.0 if side == "right" else -1.0
    shifted = {name: x for name, x in curves.items() if name == "pelvis_rotation"}
    if "pelvis_tilt" in curves:
        shifted["pelvis_tilt"] = curves["pelvis_tilt"] + zero.get("pelvis_tilt", 0.0)
    if "pelvis_obliquity" in curves:
        shifted["pelvis_obliquity"] = curves["pelvis_obliquity"] + own * zero.get("pelvis_obliquity", 0.0)
    for name in (name for rows in SIGNS.values() for name, _, _ in rows):
        if name in curves:
            shifted[name] = curves[name] + zero.get(f"{name}_{SUFFIX[side]}", 0.0)
    return shifted


def find_better_side(curves: Mapping[Side, Mapping[str, Floats]], norm: Mapping[str, Floats]) -> Side | None:
    """Return the side whose sagittal curves are closer in shape to the norm, with means removed; rad.

    Uses the mean of root mean squares as in `gps_sagittal`, without offsets since our angles are relative to
    standing. None without both sides and the norm, as there is no basis for a choice.
    """
    distances: dict[Side, float] = {
        side: sum(_unlike(own[name], norm[name]) for name in SAGITTAL)
        for side, own in curves.items()
        if all(name in own and name in norm for name in SAGITTAL)
    }
    if len(distances) < len(SIDES):
        return None
    return "left" if distances["left"] <= distances["right"] else "right"


def _unlike(a: Floats, b: Floats) -> float:
    x = np.linspace(0.0, 1.0, len(a))
    resampled = np.interp(x, np.linspace(0.0, 1.0, len(b)), b)
    return float(np.std(a - resampled))
