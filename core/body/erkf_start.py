"""The first state of the ErKF: from standing, or mid-walk with wide uncertainty of tilt and velocity.

Tilt comes from the mean specific force; heading from the convention that all segments face +x at the start
(a common heading, free gauge); positions from the tree with the ankles at their height over the floor, so
that joint centres coincide. Source: spec/estimators.md §3.5.
"""

from __future__ import annotations

import numpy as np

from core.body.erkf import ErkfInputs, ErkfParams, ErkfState
from core.body.tree import ImuTree
from core.frames import Floats
from core.rotation import from_matrix, rotate, to_matrix

MOVING_S = 1.0
"""Time over which gravity is averaged where no sample is at rest, about one stride."""


def start_state(
    tree: ImuTree,
    inputs: ErkfInputs,
    params: ErkfParams,
    rest: tuple[int, int] | None = None,
    q: Floats | None = None,
    bias_age_s: float | None = None,
) -> ErkfState:
    """State at the first sample, before any correction.

    Parameters
    ----------
    rest : samples start … stop − 1 at which everybody stands still, beginning close to the first sample; None
        for a recording that starts mid-walk: tilt and velocity are then taken as widely unknown.
    q : (n, 4) sensor orientations at the first sample from elsewhere (an orientation filter); else from
        gravity.
    bias_age_s : for a start mid-walk, time to the rest, elsewhere in the take, whose mean rate was taken off
        as gyroscope bias: the bias has walked since, no more. None when there was no rest at all: biases are
        widely unknown, and one foot alone then takes errors of scale and impact for them (30 mm per stride on
        a real walk whose only rest is at its end).
    """
    n, m = len(tree.imus), params.states
    standing = rest is not None
    a, b = rest or (0, max(1, int(np.searchsorted(np.cumsum(inputs.step_s), MOVING_S))))
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
    P = np.zeros((n * m, n * m))
    up = to_matrix(q)[:, 2, :]
    for i in range(n):
        sd = np.concatenate(
            [
                np.full(3, s)
                for s in (params.start_position_sd, velocity, tilt, bias, params.start_acc_bias_sd)
            ]
        )[:m]
        block = np.diag(sd**2)
        block[6:9, 6:9] += params.start_heading_sd**2 * np.outer(up[i], up[i])
        P[i * m : (i + 1) * m, i * m : (i + 1) * m] = block
    return ErkfState(
        nominal=nominal,
        P=P,
        before=np.concatenate((inputs.acc[0], inputs.gyr[0]), axis=1),
        injected=np.zeros(n * m),
        refused=np.zeros(n, np.int64),
    )


def chain_positions(tree: ImuTree, q: Floats) -> Floats:
    """Sensor positions (n, 3) in W that make the joint centres coincide, given orientations (n, 4)."""
    p = np.full((len(tree.imus), 3), np.nan)
    parts = []
    for root in tree.roots():
        p[root] = tree.origin[root] + rotate(tree.segment_q(q)[root], tree.place[root])
        part, joints = [root], list(tree.joints)
        while joints:
            joint = next((j for j in joints if not np.isnan(p[j.proximal, 0])), None)
            if joint is None:
                break
            joints.remove(joint)
            centre = p[joint.proximal] + rotate(q[joint.proximal], joint.r_proximal)
            if np.isnan(p[joint.distal, 0]):
                p[joint.distal] = centre - rotate(q[joint.distal], joint.r_distal)
                part.append(joint.distal)
        parts.append(part)
    for part in parts:
        feet = [i for i in part if i in tree.feet]
        if feet:
            height = tree.segment_origin(p, q)[feet, 2] - tree.origin[feet, 2]
            p[part, 2] -= height.min()
    return p


def _level(f: Floats, forward: Floats) -> Floats:
    """Orientation (4,) with f upwards and the forward axis towards +x."""
    z = f / np.linalg.norm(f)
    y = np.cross(z, forward)
    y /= np.linalg.norm(y)
    return from_matrix(np.stack((np.cross(y, z), y, z)))
