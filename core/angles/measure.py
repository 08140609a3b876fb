"""Orientations of a recording → joint angles relative to standing (docs/science/joint-angles.md)."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import radians
from typing import TYPE_CHECKING, Final

import numpy as np

from sagittal.core.angles.cardan import compute_headings
from sagittal.core.angles.kernel import AngleKernel, mean_angles, subtract_zero
from sagittal.core.angles.result import SIGNS, JointAngles, list_leg_joints
from sagittal.core.errors import Notice
from sagittal.core.frames import SIDES, SUFFIX, Bools, Floats, Posture
from sagittal.core.message import Message
from sagittal.core.signals.held_samples import cut_blocks, give_pages_back, make_room
from sagittal.core.signals.rest import Window, index_window

if TYPE_CHECKING:
    from sagittal.core.body.poses import Poses
    from sagittal.core.fusion.orientations import Orientations

GIMBAL_LIMIT: Final = radians(80.0)
"""|b| beyond which a and c cannot be told apart (docs/science/joint-angles.md, "Joints")."""


def measure_angles(
    orientations: Orientations,
    zero: Window,
    poses: Poses | None = None,
    standing_deg: Mapping[str, float] | None = None,
    posture: Posture = "standing",
    dropped: Collection[str] = (),
) -> JointAngles:
    """Angles of every joint with both segments available, zeroed on the mean over a window.

    Parameters
    ----------
    orientations : segment orientations in W.
    zero : window whose mean angles are subtracted, seconds.
    poses : pose estimate covering more segments than have a sensor. A joint without both sensors takes its
    angles from it; `diagnostics["estimated"]` lists them.
    standing_deg : goniometer angles in the same standing posture; stored with the angles, not added.
    posture : activity in that window. With the mean of walking, goniometer angles cannot provide the
    anatomical zero.
    dropped : angles from `poses` that are not requested: their zero and notices are computed, their samples
    are not stored.

    Returns
    -------
    JointAngles; a joint with a missing segment has no entry and a notice `joint_missing`, a joint whose |b|
    exceeds 80° a notice `gimbal`; a joint without signal while standing is omitted with `no_standing_zero`.
    """
    kernel = AngleKernel.between(tuple(orientations.q), () if poses is None else tuple(poses.q))
    standing = kernel.measure(*_stack(orientations, poses, index_window(zero, orientations.rate_hz)))
    is_known = [bool(x.any()) for x in np.isfinite(standing).T]
    offset = mean_angles(standing)
    retained = [i for i, x in enumerate(is_known) if x]
    n = len(orientations.t_s)
    held: dict[int, Floats] = {
        i: make_room(n) for i in retained if not (kernel.estimated[i] and kernel.names[i] in dropped)
    }
    locked = np.empty((n, len(kernel.names)), np.bool_)
    for part in cut_blocks(n):
        raw = kernel.measure(*_stack(orientations, poses, part))
        locked[part] = np.abs(raw) > GIMBAL_LIMIT
        for i, angle in held.items():
            angle[part] = subtract_zero(raw[:, i], offset[i])
        give_pages_back((*held.values(), *(() if poses is None else poses.q.values())))
    notices = _find_missing_joints(orientations, kernel) + _find_gimbal(locked, kernel, orientations.t_s)
    for name in sorted(name for name, x in zip(kernel.names, is_known, strict=True) if not x):
        message = Message(
            "{name}: no angle, because its sensors have no signal during quiet standing ({zero:.1f} to "
            "{zero2:.1f} s) and the zero is undefined.",
            name=name,
            zero=zero[0],
            zero2=zero[1],
        )
        notices.append(Notice("no_standing_zero", message, t_s=zero[0]))
    return JointAngles(
        orientations.t_s,
        {kernel.names[i]: angle for i, angle in held.items()},
        {kernel.names[i]: float(offset[i]) for i in retained},
        notices=tuple(notices),
        diagnostics={"estimated": tuple(kernel.names[i] for i in retained if kernel.estimated[i])},
        zero=posture,
        standing_deg=dict(standing_deg or {}) if posture == "standing" else {},
        headings=compute_headings(orientations),
    )


def _stack(orientations: Orientations, poses: Poses | None, part: slice) -> tuple[Floats, Bools]:
    """Orientations (n, S, 4) of the sensor segments, then of the pose estimate, and validity (n, S); for a
    slice.
    """
    q = [x[part] for x in orientations.q.values()]
    validity = [orientations.valid[s][part] for s in orientations.q]
    if poses is not None:
        q += [x[part] for x in poses.q.values()]
        validity += [poses.valid[part]] * len(poses.q)
    if not q:
        n = len(orientations.t_s[part])
        return np.empty((n, 0, 4)), np.empty((n, 0), np.bool_)
    return np.stack(q, axis=1), np.stack(validity, axis=1)


def _find_missing_joints(orientations: Orientations, kernel: AngleKernel) -> list[Notice]:
    """One notice for every joint without angles."""
    notices: list[Notice] = []
    for side in SIDES:
        for joint, proximal, distal in list_leg_joints(side):
            if f"{SIGNS[joint][0][0]}_{SUFFIX[side]}" in kernel.names:
                continue
            missing = [s for s in (proximal, distal) if s not in orientations.q]
            message = Message(
                "{side} {joint}: no angles, because there is no sensor on {missing}; attach or assign one.",
                side=side,
                joint=joint,
                missing=" and ".join(missing),
            )
            notices.append(Notice("joint_missing", message, sensor=missing[0]))
    return notices


def _find_gimbal(locked: Bools, kernel: AngleKernel, t_s: Floats) -> list[Notice]:
    """One notice for every joint whose frontal angle exceeds the gimbal limit; `locked` (n, names)."""
    notices: list[Notice] = []
    for side in SIDES:
        for joint, _, _ in list_leg_joints(side):
            frontal = f"{SIGNS[joint][1][0]}_{SUFFIX[side]}"
            if frontal not in kernel.names:
                continue
            beyond = locked[:, kernel.names.index(frontal)]
            if beyond.any():
                message = Message(
                    "{side} {joint}: the frontal angle exceeds 80° in {mean:.1%} of the trial, where "
                    "flexion and rotation cannot be separated; check which segment each sensor is on.",
                    side=side,
                    joint=joint,
                    mean=beyond.mean(),
                )
                notices.append(Notice("gimbal", message, t_s=float(t_s[int(np.argmax(beyond))])))
    return notices
