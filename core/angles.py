"""Joint angles: one sequence, one sign table (docs/science/joint-angles.md).

Joints: R = R_proximalᵀ R_distal = Rz(a) Rx(b) Ry(c), the joint coordinate system of Grood and Suntay 1983 in
ISB frames: a about the proximal medio-lateral axis, b about the floating axis, c about the distal long axis.
Pelvis: R_W_neutralᵀ R_pelvis = Ry(rotation) Rx(b) Rz(tilt), intrinsic Y-X-Z (Baker 2001), so that tilt and
obliquity do not depend on the direction of walking.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import radians
from typing import TYPE_CHECKING, Final

import numpy as np

from core.errors import Notice
from core.frames import FOOT, R_NEUTRAL, SHANK, SIDES, SUFFIX, THIGH, Bools, Floats, Oriented, Segment, Side
from core.rest import Window, samples
from core.rotation import conjugate, from_matrix, multiply, rotate, to_matrix

if TYPE_CHECKING:
    # these packages bring numba, which readers of results do without
    from core.body.poses import Poses
    from core.fusion.orientations import Orientations

GIMBAL_LIMIT: Final = radians(80.0)
"""|b| beyond which a and c cannot be told apart (docs/science/joint-angles.md, "Joints")."""

SIGNS: Final[dict[str, tuple[tuple[str, float, float], ...]]] = {
    "hip": (("hip_flexion", 1, 1), ("hip_adduction", 1, -1), ("hip_rotation", 1, -1)),
    "knee": (("knee_flexion", -1, -1), ("knee_adduction", 1, -1), ("knee_rotation", 1, -1)),
    "ankle": (("ankle_dorsiflexion", 1, 1), ("ankle_inversion", 1, -1), ("ankle_rotation", 1, -1)),
}
"""Joint → (name, sign right, sign left) of a, b, c.

Positive: flexion, dorsiflexion; adduction, varus, inversion; internal rotation.
"""


@dataclass(frozen=True, eq=False)
class JointAngles:
    """Joint angles in rad on the uniform axis; NaN where a segment was lost.

    Parameters
    ----------
    angles : name → (n,), names as in the exports without the unit: "pelvis_tilt", "pelvis_obliquity",
        "hip_flexion_l", "hip_adduction_l", "hip_rotation_l", "knee_flexion_l", "knee_adduction_l",
        "knee_rotation_l", "ankle_dorsiflexion_l", "ankle_inversion_l", "ankle_rotation_l", right alike.
        Pelvis tilt: anterior positive. Pelvis obliquity: right side up is positive.
        Zero is the mean over the calibration's standing window.
    zero_offset : name → rad that was subtracted (the raw standing angle).
    zero : "standing" (the only zero so far).
    standing_deg : angles of that standing by goniometer, where somebody entered them; see
        `core.standing_angles`, and `core.parameters.anatomical_zero`, which adds them back.
    headings : "pelvis", "foot_l", "foot_r" → (n,) rad about the vertical, left positive, unwrapped, from a
        zero of its own; only of segments with a sensor. Its course over a stride means something.
    withheld : angles that were taken out again → reason (`core.withheld`).
    bounds : name → rad, the straight knee of a leg model: at it the angle is a limit and no measurement.
    """

    t_s: Floats
    angles: Mapping[str, Floats]
    zero_offset: Mapping[str, float]
    zero: str = "standing"
    notices: tuple[Notice, ...] = ()
    diagnostics: Mapping[str, object] = field(default_factory=dict)
    standing_deg: Mapping[str, float] = field(default_factory=dict)
    headings: Mapping[str, Floats] = field(default_factory=dict)
    withheld: Mapping[str, str] = field(default_factory=dict)
    bounds: Mapping[str, float] = field(default_factory=dict)


def joint_angles(
    orientations: Orientations,
    zero: Window,
    poses: Poses | None = None,
    standing_deg: Mapping[str, float] | None = None,
) -> JointAngles:
    """Angles of every joint whose two segments are there, zeroed on the mean over the standing window.

    Parameters
    ----------
    orientations : segment orientations in W.
    zero : window whose mean angles are subtracted, seconds.
    poses : of an estimator that knows more segments than have a sensor. A joint that has not both its sensors
        takes its angles from there; `diagnostics["estimated"]` names them.
    standing_deg : goniometer angles of that standing; kept beside the angles, not added.

    Returns
    -------
    JointAngles; a joint with a missing segment has no entry and a notice `joint_missing`, a joint whose |b|
    passes 80° a notice `gimbal`, one without signal while standing is left out with `no_standing_zero`.
    """
    raw: dict[str, Floats] = {}
    estimated: list[str] = []
    notices: list[Notice] = []
    pelvis = _source(orientations, poses, "pelvis")
    if pelvis is not None:
        q, ok = pelvis
        for name, value in zip(("pelvis_tilt", "pelvis_obliquity"), pelvis_angles(q["pelvis"]), strict=True):
            raw[name] = np.where(ok, value, np.nan)
            estimated += [name] if q is not orientations.q else []
    for side in SIDES:
        for joint, proximal, distal in joints(side):
            source = _source(orientations, poses, proximal, distal)
            if source is None:
                missing = [s for s in (proximal, distal) if s not in orientations.q]
                message = (
                    f"{side} {joint}: no angles, no sensor on {' and '.join(missing)}; wear or map one there."
                )
                notices.append(Notice("joint_missing", message, sensor=missing[0]))
                continue
            q, ok = source
            abc = cardan_zxy(multiply(conjugate(q[proximal]), q[distal]))
            notices += _gimbal(abc[:, 1], ok, side, joint, orientations.t_s)
            for (base, right, left), value in zip(SIGNS[joint], abc.T, strict=True):
                name = f"{base}_{SUFFIX[side]}"
                raw[name] = np.where(ok, (right if side == "right" else left) * value, np.nan)
                estimated += [name] if q is not orientations.q else []
    part = samples(zero, orientations.rate_hz)
    standing = {name for name, value in raw.items() if np.isfinite(value[part]).any()}
    for name in sorted(raw.keys() - standing):
        message = (
            f"{name}: no angle, its sensors have no signal while standing ({zero[0]:.1f} to {zero[1]:.1f} "
            "s), so "
            "there is no zero."
        )
        notices.append(Notice("no_standing_zero", message, t_s=zero[0]))
    offset = {name: _circular_mean(raw[name][part]) for name in raw if name in standing}
    angles = {name: _wrap(raw[name] - zero_angle) for name, zero_angle in offset.items()}
    return JointAngles(
        orientations.t_s,
        angles,
        offset,
        notices=tuple(notices),
        diagnostics={"estimated": tuple(name for name in estimated if name in angles)},
        standing_deg=dict(standing_deg or {}),
        headings=headings(orientations),
    )


def headings(orientations: Oriented) -> dict[str, Floats]:
    """Course of pelvis and feet about the vertical, as `JointAngles.headings`; NaN where lost.

    The pelvis turns with its medio-lateral axis, as in the decomposition above; a foot points with its own.
    """
    found: dict[str, Floats] = {}
    for segment, axis in _COURSES.items():
        if segment not in orientations.q:
            continue
        ok = orientations.valid[segment]
        x, y, _ = rotate(orientations.q[segment][ok], np.array(axis)).T
        course = np.full(len(ok), np.nan)
        course[ok] = np.unwrap(np.arctan2(y, x))
        found[segment] = course
    return found


_COURSES: Final[dict[Segment, tuple[float, float, float]]] = {
    "pelvis": (0.0, 0.0, 1.0),
    "foot_l": (1.0, 0.0, 0.0),
    "foot_r": (1.0, 0.0, 0.0),
}
"""Segment → the axis whose direction over the floor is its course: the pelvis's right, a foot's front."""


def _source(
    orientations: Orientations, poses: Poses | None, *segments: Segment
) -> tuple[Mapping[Segment, Floats], Bools] | None:
    """Where these segments are known together, sensors first: their orientations, and when valid."""
    if all(s in orientations.q for s in segments):
        return orientations.q, np.logical_and.reduce([orientations.valid[s] for s in segments])
    if poses is not None and all(s in poses.q for s in segments):
        return poses.q, poses.valid
    return None


def joints(side: Side) -> tuple[tuple[str, Segment, Segment], ...]:
    """Joints of one leg as (joint, proximal segment, distal segment)."""
    return (
        ("hip", "pelvis", THIGH[side]),
        ("knee", THIGH[side], SHANK[side]),
        ("ankle", SHANK[side], FOOT[side]),
    )


def cardan_zxy(q: Floats) -> Floats:
    """Angles (..., 3) = (a, b, c) in rad of q (..., 4) = Rz(a) Rx(b) Ry(c)
    (docs/science/joint-angles.md, "Joints")."""
    R = to_matrix(q)
    a = np.arctan2(-R[..., 0, 1], R[..., 1, 1])
    b = np.arcsin(np.clip(R[..., 2, 1], -1.0, 1.0))
    c = np.arctan2(-R[..., 2, 0], R[..., 2, 2])
    return np.stack((a, b, c), axis=-1)


def pelvis_angles(q: Floats) -> tuple[Floats, Floats]:
    """Anterior tilt and obliquity (right side up) in rad of the pelvis q (..., 4) in W (Baker 2001)."""
    R = to_matrix(multiply(conjugate(from_matrix(R_NEUTRAL)), q))
    tilt = -np.arctan2(R[..., 1, 0], R[..., 1, 1])
    obliquity = -np.arcsin(np.clip(-R[..., 1, 2], -1.0, 1.0))
    return np.asarray(tilt), np.asarray(obliquity)


def _gimbal(b: Floats, ok: Bools, side: Side, joint: str, t_s: Floats) -> list[Notice]:
    beyond = ok & (np.abs(b) > GIMBAL_LIMIT)
    if not beyond.any():
        return []
    share = beyond.mean()
    message = (
        f"{side} {joint}: the frontal angle passes 80° in {share:.1%} of the take; there flexion and "
        "rotation cannot be told apart; check which segment each sensor is on."
    )
    return [Notice("gimbal", message, t_s=float(t_s[int(np.argmax(beyond))]))]


def _circular_mean(x: Floats) -> float:
    """Mean angle in rad over the finite samples."""
    x = x[np.isfinite(x)]
    return float(np.arctan2(np.sin(x).mean(), np.cos(x).mean()))


def _wrap(x: Floats) -> Floats:
    return np.asarray((x + np.pi) % (2 * np.pi) - np.pi)
