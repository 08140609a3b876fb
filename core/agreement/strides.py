"""Strides of a leg sensor without calibration, and its orientation on the segment in each of them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.agreement.params import SlipParams
from sagittal.core.agreement.terms import SensorMotion
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.rotation import conjugate, exp, find_lengths, rotate, to_matrix
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.peaks import find_peaks

SMOOTH_HZ: Final = 4.0
LEAST_SWING: Final = 0.6
"""A leg whose fastest swing is slower, rad/s, does not walk."""

HEIGHT: Final = 0.45
"""Mid-swings are peaks above this share of the fastest."""

SHORTEST_S: Final = 0.6
LONGEST_S: Final = 2.5
USUAL: Final = (0.6, 1.5)
"""Strides of other length, of the median, are left out."""

POINTS: Final = 40
"""Samples of a stride's curve."""


@dataclass(frozen=True, eq=False)
class StrideTurns:
    """Sensor rotation per stride: start_s, end_s (k,); turn (k, 3) rad relative to its typical alignment."""

    start_s: Floats
    end_s: Floats
    turn: Floats


def find_main_axis(rate: Floats) -> Floats:
    """Unit axis (3,) of the largest rotation of a sensor; rate (n, 3) rad/s."""
    return find_largest_axis(rate.T @ rate)


def find_largest_axis(moments: Floats) -> Floats:
    """Unit axis (3,) of the largest rotation from the sum of products (3, 3) of the rate."""
    return np.ascontiguousarray(np.linalg.eigh(moments)[1][:, -1])


def find_swings(rate: Floats, rate_hz: float) -> NDArray[np.int64]:
    """Mid-swing samples (k,) of a leg: peaks of the rate about its main axis, with the larger lobe
    positive.
    """
    x = low_pass(rate @ find_main_axis(rate), SMOOTH_HZ, rate_hz)
    low, high = np.percentile(x, (2, 98))
    x, top = (x, high) if high >= -low else (-x, -low)
    if top < LEAST_SWING:
        return np.zeros(0, np.int64)
    return find_peaks(x, height=HEIGHT * top, distance=max(1, round(SHORTEST_S * rate_hz)))


def choose_leg(segment: Segment) -> tuple[Segment, ...]:
    """Sensors whose swings delimit the strides of this one, best first."""
    sides = ("r", "l") if segment == "pelvis" else (segment[-1],)
    return tuple(f"{part}_{side}" for side in sides for part in ("shank", "foot", "thigh"))  # type: ignore[misc]


def find_stride_turns(
    motion: SensorMotion, valid: Bools, borders: NDArray[np.int64], rate_hz: float, params: SlipParams
) -> StrideTurns:
    """Rotation that best aligns the vertical and rate curves of each stride with the typical stride.

    The vertical of a stride is its mean specific force; the orientation within it is integrated from its
    start, so that earlier strides have no influence.
    """
    length = np.diff(borders)
    usual = float(np.median(length)) if len(length) else 0.0
    q, rate, level = motion.q, motion.rate, motion.level
    smooth = low_pass(np.ascontiguousarray(rate.T), 15.0, rate_hz).T
    curves, spans = [], []
    for a, b in pairwise(borders):
        if not USUAL[0] * usual <= b - a <= USUAL[1] * usual or b - a > LONGEST_S * rate_hz:
            continue
        if not valid[a : b + 1].all():
            continue
        up = level[:, a:b].mean(axis=1)
        up /= np.linalg.norm(up)
        if abs(float(np.sum(rotate(q[a:b], rate[a:b]) @ up))) / rate_hz > params.straight_rad:
            continue
        k = a + (np.arange(POINTS) * (b - a)) // POINTS
        curves.append(np.concatenate((rotate(conjugate(q[k]), np.tile(up, (POINTS, 1))), smooth[k])))
        spans.append((a / rate_hz, b / rate_hz))
    if len(curves) < 2 * params.strides:
        return StrideTurns(np.zeros(0), np.zeros(0), np.zeros((0, 3)))
    x = np.array(curves)
    # together the rates weigh half of the vertical
    x[:, POINTS:] *= 0.5 / max(float(np.sqrt((x[:, POINTS:] ** 2).sum(axis=2).mean())), 0.5)
    turn = np.zeros((len(x), 3))
    for _ in range(2):
        typical = np.median(x @ to_matrix(exp(turn)), axis=0)
        turn = _fit_rotation(typical, x)
    limits_s = np.array(spans)
    return StrideTurns(limits_s[:, 0], limits_s[:, 1], turn)


def _fit_rotation(P: Floats, Q: Floats) -> Floats:
    """Rotation vectors (k, 3) that best align P (m, 3) with each of Q (k, m, 3) (Wahba's problem, by SVD)."""
    U, _, Vt = np.linalg.svd(np.einsum("kmi,mj->kij", Q, P))
    U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    R = U @ Vt
    v = 0.5 * np.stack((R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]), axis=1)
    s = find_lengths(v)
    angle = np.arctan2(s, 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0))
    return np.asarray(v * (angle / np.maximum(s, 1e-12))[:, None])
