"""The initial state of the ErKF: from standing, or mid-walk with large uncertainty of tilt and velocity.

Tilt comes from the mean specific force; heading from the convention that all segments face +x at the start (a
common heading is a free gauge); positions from the tree with the ankles at their height above the floor, so
that joint centres coincide. Equations: docs/science/erkf.md, "Start".

Errors of the initial orientations propagate into the initial positions, so the initial covariance correlates
both: if they were independent, the joint centres of a standing person, which carry no information on
headings, would appear to measure them. The common heading is not observable, and its uncertainty is excluded:
otherwise the linearised filter appears to gain information on it in every turn and shifts the whole path,
including strides.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sagittal.core.body.erkf.filter import ErkfInputs, ErkfState
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.tree import ImuTree, Joint
from sagittal.core.frames import Floats
from sagittal.core.rotation import from_matrix, rotate, to_matrix

MOVING_S = 1.0
"""Time over which gravity is averaged where no sample is at rest, about one stride."""


def start_state(
    tree: ImuTree,
    inputs: ErkfInputs,
    params: ErkfParams,
    standing_range: tuple[int, int] | None = None,
    q: Floats | None = None,
    bias_age_s: float | None = None,
) -> ErkfState:
    """The state at the first sample, before any correction.

    Parameters
    ----------
    standing_range : samples start … stop − 1 of quiet standing, beginning close to the first sample; None for
        a recording that starts mid-walk: tilt and velocity then have a large uncertainty.
    q : (n, 4) sensor orientations at the first sample from another source (an orientation filter); else from
        gravity.
    bias_age_s : for a start mid-walk, time to the rest elsewhere in the recording whose mean rate was
        subtracted as gyroscope bias: the uncertainty is that of the random walk in between. None without any
        rest: biases have a large uncertainty, and for a single foot they absorb errors of scale and impact
        (30 mm per stride in a real walk with a rest only at its end).
    """
    n, m = len(tree.imus), params.states
    standing = standing_range is not None
    a, b = standing_range or (0, max(1, int(np.searchsorted(np.cumsum(inputs.step_s), MOVING_S))))
    if q is None:
        q = np.stack(
            [_level(f, x) for f, x in zip(inputs.acc[a:b].mean(axis=0), tree.forward(), strict=True)]
        )
    nominal = np.zeros((n, 16))
    nominal[:, 0:3] = chain_positions(tree, q)
    nominal[:, 6:10] = q
    tilt = params.start_tilt_sd if standing else params.moving_tilt_sd
    velocity = params.start_velocity_sd if standing else params.moving_velocity_sd
    age_s = 0.0 if standing else bias_age_s
    bias = params.moving_gyr_bias_sd
    if age_s is not None:
        bias = float(np.hypot(params.start_gyr_bias_sd, params.gyr_walk * np.sqrt(age_s)))
    sd = np.repeat((params.start_position_sd, velocity, tilt, bias, params.start_acc_bias_sd), 3)[:m]
    P = np.diag(np.tile(sd**2, n))
    up, part, heading = to_matrix(q)[:, 2, :], find_parts(tree), np.eye(n)
    if inputs.heading is None:
        # the heading that all have in common is nobody's error: it is what W's x means
        same = part[:, None] == part
        heading -= same / same.sum(axis=0)
    for i, j in zip(*np.nonzero(heading), strict=True):
        shared = params.start_heading_sd**2 * heading[i, j] * np.outer(up[i], up[j])
        P[i * m + 6 : i * m + 9, j * m + 6 : j * m + 9] += shared
    spread = _spread(tree, q, m)
    P = spread @ P @ spread.T
    return ErkfState(
        nominal=nominal,
        P=0.5 * (P + P.T),
        before=np.concatenate((inputs.acc[0], inputs.gyr[0]), axis=1),
        injected=np.zeros(n * m),
        refused=np.zeros(n, np.int64),
    )


def chain_positions(tree: ImuTree, q: Floats) -> Floats:
    """Sensor positions (n, 3) in W that make the joint centres coincide, given orientations (n, 4)."""
    p, part = np.full((len(tree.imus), 3), np.nan), find_parts(tree)
    for root in tree.roots():
        p[root] = tree.origin[root] + rotate(tree.segment_q(q)[root], tree.place[root])
    for joint in _outward(tree):
        centre = p[joint.proximal] + rotate(q[joint.proximal], joint.r_proximal)
        p[joint.distal] = centre - rotate(q[joint.distal], joint.r_distal)
    for one in set(part.tolist()):
        feet = [i for i in tree.feet if part[i] == one]
        if feet:
            height = tree.segment_origin(p, q)[feet, 2] - tree.origin[feet, 2]
            p[part == one, 2] -= height.min()
    return p


def find_parts(tree: ImuTree) -> NDArray[np.int64]:
    """Root (n,) of the connected part of the tree that each sensor belongs to."""
    part = np.arange(len(tree.imus))
    for joint in _outward(tree):
        part[joint.distal] = part[joint.proximal]
    return part


def _outward(tree: ImuTree) -> Iterator[Joint]:
    """Joints in order from the roots outward."""
    reached, joints = set(tree.roots()), list(tree.joints)
    while joint := next((j for j in joints if j.proximal in reached), None):
        joints.remove(joint)
        if joint.distal not in reached:
            reached.add(joint.distal)
            yield joint


def _spread(tree: ImuTree, q: Floats, m: int) -> Floats:
    """Derivative (n·m, n·m) of the initial errors by independent ones: the position error of a sensor in
    the chain includes that of its neighbour and, through the lever arms, those of both orientations.
    """
    R = to_matrix(q)
    # np.cross(1, r) = [r]×
    J = np.eye(len(R) * m)
    for joint in _outward(tree):
        a, b = joint.proximal * m, joint.distal * m
        J[b : b + 3] += J[a : a + 3]
        J[b : b + 3, a + 6 : a + 9] -= R[joint.proximal] @ np.cross(np.eye(3), joint.r_proximal)
        J[b : b + 3, b + 6 : b + 9] += R[joint.distal] @ np.cross(np.eye(3), joint.r_distal)
    return J


def _level(f: Floats, forward: Floats) -> Floats:
    """Orientation (4,) with f pointing up and the forward axis towards +x."""
    z = f / np.linalg.norm(f)
    y = np.cross(z, forward)
    y /= np.linalg.norm(y)
    return from_matrix(np.stack((np.cross(y, z), y, z)))
