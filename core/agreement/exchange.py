"""Sensors on other segments than was declared: by which of them share a joint, and by which hip is which.

A joint's acceleration seen from both sides agrees only where two sensors share that joint. So every labelling
that is a likely mistake is scored by the joints it would make. Exchanging whole legs leaves the joints as
they are; there the places of the hips, left and right of the way the feet go, tell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Final, TypeVar

import numpy as np

from core.agreement.joints import LEG_JOINTS
from core.agreement.params import ExchangeParams, JointParams
from core.agreement.strides import find_swings
from core.agreement.terms import SensorTerms, cut_terms
from core.agreement.windows import JointWindows, compare_at_joint
from core.frames import FOOT, SHANK, SIDES, THIGH, Floats, Segment
from core.rotation import rotate

Swap = tuple[tuple[Segment, Segment], ...]
"""Pairs of segments whose sensors are exchanged."""

SWAPS: Final[tuple[Swap, ...]] = (
    (("thigh_l", "thigh_r"),),
    (("shank_l", "shank_r"),),
    (("foot_l", "foot_r"),),
    *(((THIGH[side], SHANK[side]),) for side in SIDES),
    *(((SHANK[side], FOOT[side]),) for side in SIDES),
    *((("pelvis", THIGH[side]),) for side in SIDES),
)
"""What is looked for. Exchanged shanks and feet are exchanged thighs on exchanged legs."""

LEGS: Final[Swap] = (("thigh_l", "thigh_r"), ("shank_l", "shank_r"), ("foot_l", "foot_r"))

WORST: Final = 2.0
"""A misfit above this says no more than this."""

Thing = TypeVar("Thing")

LEAST_SAYING: Final = 3
"""Swings from which a direction of walking is believed."""

LONGEST_SWING_S: Final = 2.0


@dataclass(frozen=True)
class SensorExchange:
    """What the joints say about the labels.

    Parameters
    ----------
    swap : to be undone, empty where the stated labels hold. ratio : misfit of the stated labels over that of
        the best others. cosine : between the line of the hips and the right-hand side of walking, of the
        labels that fit; None where it cannot be said.
    """

    swap: Swap
    ratio: float
    cosine: float | None


def find_exchange(
    terms: Mapping[Segment, SensorTerms],
    joints: Sequence[JointWindows],
    rate_hz: float,
    joint_params: JointParams,
    params: ExchangeParams,
) -> SensorExchange:
    """Judge the stated labels on the first minute of walking.

    Parameters
    ----------
    terms : of all worn leg sensors and the pelvis. joints : of the stated labels, over the whole take.
    """
    moving = [w.t_s[0] - 0.5 * w.width_s for w in joints if len(w.t_s)]
    if len(joints) < 2 or not moving:
        return SensorExchange((), 0.0, None)
    start = max(0.0, min(moving))
    part = {s: cut_terms(x, start, start + params.over_s) for s, x in terms.items()}
    compared: dict[frozenset[Segment], JointWindows] = {
        frozenset((a, b)): compare_at_joint((a, b), part[a], part[b], joint_params)
        for a, b in combinations(part, 2)
    }
    misfits = {k: float(np.median(np.minimum(w.residual, WORST))) for k, w in compared.items() if len(w.t_s)}
    stated = _score(misfits, ())
    possible = [x for x in SWAPS if all(s in part for pair in x for s in pair)]
    scores = {x: _score(misfits, x) for x in possible}
    best = min(scores, key=lambda x: scores[x], default=())
    ratio = stated / scores[best] if best else 0.0
    swap: Swap = best if ratio > params.ratio else ()
    cosine = _compare_hips(part, swap, joint_params, rate_hz, params)
    if cosine is not None and cosine < params.cosine:
        swap = _simplify((*swap, *LEGS))
    return SensorExchange(swap, ratio, cosine)


def undo_exchange(swap: Swap, by_segment: Mapping[Segment, Thing]) -> dict[Segment, Thing]:
    """The same things on the segments they belong to."""
    out = dict(by_segment)
    for a, b in swap:
        out[a], out[b] = out[b], out[a]
    return out


def _score(misfits: Mapping[frozenset[Segment], float], swap: Swap) -> float:
    """Geometric mean of the misfits of the joints under a labelling: ankles fit best, so shares count."""
    name = {s: s for joint in LEG_JOINTS for s in joint}
    for a, b in swap:
        name[a], name[b] = b, a
    found = [misfits.get(frozenset((name[a], name[b]))) for a, b in LEG_JOINTS]
    said = [x for x in found if x is not None]
    return float(np.exp(np.mean(np.log(said)))) if said else np.inf


def _simplify(swap: Swap) -> Swap:
    """Pairs that together do what several exchanges in turn do, each segment once."""
    where = undo_exchange(swap, {s: s for pair in swap for s in pair})
    return tuple((a, b) for a, b in where.items() if a < b and where[b] == a)


def _compare_hips(
    stated: Mapping[Segment, SensorTerms],
    swap: Swap,
    joint_params: JointParams,
    rate_hz: float,
    params: ExchangeParams,
) -> float | None:
    """Cosine between the line from the left to the right hip and the right-hand side of walking.

    The way of a foot over a swing is turned into the level frame of the pelvis by the turns of the joints.
    """
    terms = undo_exchange(swap, stated)
    if not all(s in terms for s in ("pelvis", "thigh_l", "thigh_r")):
        return None

    def compare(a: Segment, b: Segment) -> JointWindows:
        return compare_at_joint((a, b), terms[a], terms[b], joint_params)

    hips = {side: compare("pelvis", THIGH[side]) for side in SIDES}
    if not all(len(w.t_s) for w in hips.values()):
        return None
    centre = {side: np.median(w.place_in("pelvis"), axis=0) for side, w in hips.items()}
    line = centre["right"] - centre["left"]
    said: list[float] = []
    for side in SIDES:
        shank, foot = SHANK[side], FOOT[side]
        if shank not in terms or foot not in terms:
            continue
        chain = (hips[side], compare(THIGH[side], shank), compare(shank, foot))
        if all(len(w.t_s) for w in chain):
            said += _cosines(terms, chain, line, rate_hz, params)
    return float(np.median(said)) if len(said) >= LEAST_SAYING else None


def _cosines(
    terms: Mapping[Segment, SensorTerms],
    chain: Sequence[JointWindows],
    line: Floats,
    rate_hz: float,
    params: ExchangeParams,
) -> list[float]:
    """One cosine per swing of a leg."""
    foot, shank = terms[chain[-1].second], terms[chain[-1].first]
    speed = np.linalg.norm(foot.rate, axis=1)
    swings, said = find_swings(shank.rate, rate_hz), []
    for a, b in pairwise(swings):
        if b - a > LONGEST_SWING_S * rate_hz or b - a < 5:
            continue
        middle = 0.5 * (a + b) / rate_hz
        turn = sum(float(w.turn[int(np.argmin(np.abs(w.t_s - middle)))]) for w in chain)
        # from mid-swing to mid-swing: constant errors out, zero velocity where the foot is quietest
        h = foot.level[:2, a:b] - foot.level[:2, a:b].mean(axis=1, keepdims=True)
        v = np.cumsum(h, axis=1) / rate_hz
        way = (v - v[:, [int(np.argmin(speed[a:b]))]]).sum(axis=1) / rate_hz
        if np.linalg.norm(way) < params.least_way_m:
            continue
        c, s = np.cos(turn), np.sin(turn)
        ahead = np.array([c * way[0] - s * way[1], s * way[0] + c * way[1]])
        across = rotate(terms["pelvis"].q[(a + b) // 2], line)[:2]
        size = np.linalg.norm(across) * np.linalg.norm(ahead)
        said.append(float((across[0] * ahead[1] - across[1] * ahead[0]) / max(size, 1e-9)))
    return said
