"""Evidence of the two sensors at a joint about their lever arms, from the acceleration of the joint centre.

Equations: docs/science/calibration.md, "Places and centres from motion".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.agreement.joints import LEG_JOINTS
from sagittal.core.agreement.terms import find_thinning, find_usable, low_pass_terms, take_mean_out
from sagittal.core.body.arm_params import ArmParams
from sagittal.core.body.corrected import correct_signals
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import conjugate, from_matrix, multiply, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.rest import index_window

ARM: Final = 3
ARMS: Final = 2 * ARM
"""Both arms of a joint, proximal first."""

ROUNDS: Final = 6
SETTLED_M: Final = 1e-4

MARGIN_S: Final = 2.0
"""Filtered along on either side of the walk: what filters make of an end is not looked at."""


@dataclass(frozen=True, eq=False)
class SensorView:
    """Acceleration terms of the points of a segment from one sensor while walking.

    M : (m, 3, 4) terms in W, columns along the segment's axes. wander : (m, 3, k) the acceleration of a point
    that moves along these axes by 1 m per radian of flexion. wander_sd : prior of that movement, m/rad.
    usable : (m,).
    """

    M: Floats
    wander: Floats
    wander_sd: float
    usable: Bools


@dataclass(frozen=True, eq=False)
class JointEvidence:
    """Information matrix L (6, 6) of both lever arms of a joint, h = L · mean (6,), and the misfit."""

    L: Floats
    h: Floats
    misfit: float


def name_kind(segment: Segment) -> str:
    """Segment name without its side."""
    return segment.split("_")[0]


def view_sensors(
    calibrated: CalibratedRecording,
    orientations: Orientations,
    segments: Sequence[Segment],
    params: ArmParams,
) -> tuple[dict[Segment, SensorView], float]:
    """All sensors over the first part of straight walking, and the rate; empty without any."""
    rate = calibrated.recording.rate_hz
    walked = np.zeros(len(calibrated.recording.t_s), np.bool_)
    for window in calibrated.calibration.walking:
        walked[index_window(window, rate)] = True
    walked &= np.cumsum(walked) <= params.longest_s * rate
    if not walked.any():
        return {}, rate
    margin = round(MARGIN_S * rate)
    first, past = int(np.argmax(walked)), len(walked) - int(np.argmax(walked[::-1]))
    part = slice(max(0, first - margin), past + margin)
    walked = walked[part]
    thin = find_thinning(rate, params.joints)
    acc, gyr, valid = correct_signals(calibrated, segments, part)
    turned = {s: orientations.q[s][part] for s in segments}
    bends = [joint for joint in LEG_JOINTS if set(joint) <= set(segments)]
    # what is faster than the band is the sensors' own shaking, which no skin follows
    smooth = params.joints.band_hz[1]
    flexions = {
        (a, b): low_pass(_measure_flexion(turned[a], turned[b], walked)[None], smooth, rate)[0]
        for a, b in bends
    }
    sides = {}
    for i, segment in enumerate(segments):
        to_segment = calibrated.calibration.segments[segment].R_segment_sensor
        q = multiply(turned[segment], from_matrix(to_segment))
        slow, _ = low_pass_terms(q[None], acc[None, :, i], gyr[None, :, i], rate, params.joints)
        M = take_mean_out(slow, rate / thin, params.joints)[0]
        # a place in segment axes instead of sensor axes
        M[:, :, :ARM] = M[:, :, :ARM] @ to_segment.T
        # of the trunk flexion of both hips is one thing, and it has hardly any skin to speak of
        bent = [x for joint, x in flexions.items() if segment in joint and segment != "pelvis"]
        usable = find_usable(valid[:, i, None], rate)[0] & walked
        wander = _accelerate(turned[segment], bent, rate, thin, params)
        sides[segment] = SensorView(M, wander, params.wander_sd.get(name_kind(segment), 0.0), usable[::thin])
    return sides, rate / thin


def _measure_flexion(proximal: Floats, distal: Floats, walked: Bools) -> Floats:
    """Flexion angle (n,) of two segments (n, 4) about the medio-lateral axis, relative to its mean in
    walking, rad.
    """
    relative = multiply(conjugate(proximal), distal)
    turn = np.unwrap(2.0 * np.arctan2(relative[:, 3], relative[:, 0]))
    return np.asarray(turn - turn[walked].mean())


def _accelerate(
    q: Floats, flexions: Sequence[Floats], rate_hz: float, thin: int, params: ArmParams
) -> Floats:
    """Acceleration (m, 3, 3 k) in W, band-passed, of points that move along segment axes (n, 4) with each
    of k flexions (n,).
    """
    if not flexions:
        return np.zeros((len(q[::thin]), 3, 0))
    low, high = params.joints.band_hz
    axes = to_matrix(q)
    ways = np.concatenate([axes * x[:, None, None] for x in flexions], axis=2)
    rows = low_pass(np.ascontiguousarray(ways.reshape(len(q), -1).T), high, rate_hz)
    step = 1.0 / rate_hz
    rows = np.gradient(np.gradient(rows, step, axis=1), step, axis=1)[:, ::thin]
    rows = rows - low_pass(rows, low, rate_hz / thin)
    return np.ascontiguousarray(rows.T).reshape(-1, 3, 3 * len(flexions))


def ask_joint(
    first: SensorView, second: SensorView, arms: Floats, spread: Floats, rate_hz: float, params: ArmParams
) -> JointEvidence | None:
    """Estimate both lever arms of a joint from its two sensors; None with too little common walking.

    Relative heading and soft-tissue movement are nuisance parameters: Gauss-Newton from the nominal arms
    (6,), whose covariance (6, 6) keeps the solution near them, after which the nuisance parameters are
    marginalised.
    """
    both_usable = first.usable & second.usable
    n = int(np.count_nonzero(both_usable))
    if n < params.least_s * rate_hz:
        return None
    A, B = first.M[both_usable], second.M[both_usable]
    wander_a, wander_b = first.wander[both_usable], second.wander[both_usable]
    ka, kb = wander_a.shape[2], wander_b.shape[2]
    nuisance_sd = np.array([params.turn_sd, *[first.wander_sd] * ka, *[second.wander_sd] * kb])
    prior = np.zeros((ARMS + len(nuisance_sd),) * 2)
    prior[:ARMS, :ARMS] = np.linalg.inv(spread)
    prior[ARMS:, ARMS:] = np.diag(nuisance_sd**-2.0)
    start = np.concatenate((arms, np.zeros(len(nuisance_sd))))
    x, independent = start.copy(), min(n, 2.0 * params.joints.band_hz[1] * params.stride_s)
    for _ in range(ROUNDS):
        near = A[:, :, :ARM] @ x[:ARM] + A[:, :, ARM] + wander_a @ x[ARMS + 1 : ARMS + 1 + ka]
        far = B[:, :, :ARM] @ x[ARM:ARMS] + B[:, :, ARM] + wander_b @ x[ARMS + 1 + ka :]
        c, s = np.cos(x[ARMS]), np.sin(x[ARMS])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        far = far @ turn.T
        off = near - far
        sideways = np.stack((far[:, 1], -far[:, 0], np.zeros(n)), axis=1)
        J = np.concatenate(
            (A[:, :, :ARM], -(turn @ B[:, :, :ARM]), sideways[:, :, None], wander_a, -(turn @ wander_b)),
            axis=2,
        ).reshape(3 * n, -1)
        variance = float(np.mean(off**2))
        weight = independent / n / (variance + params.noise_mps2**2)
        H, g = weight * (J.T @ J), weight * (J.T @ off.reshape(-1))
        step = np.linalg.solve(H + prior, g + prior @ (x - start))
        x = x - step
        if np.abs(step[:ARMS]).max() < SETTLED_M:
            break
    misfit = float(np.sqrt(variance / max(float(np.mean(near**2)), 1e-12)))
    # the arms' own information: without the prior, which the whole body has
    H[ARMS:, ARMS:] += prior[ARMS:, ARMS:]
    g[ARMS:] += prior[ARMS:, ARMS:] @ (x + step)[ARMS:]
    eliminate = np.linalg.solve(H[ARMS:, ARMS:], H[ARMS:, :ARMS]).T
    L = H[:ARMS, :ARMS] - eliminate @ H[ARMS:, :ARMS]
    return JointEvidence(L, L @ (x + step)[:ARMS] - (g[:ARMS] - eliminate @ g[ARMS:]), misfit)
