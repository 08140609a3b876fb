"""Detection of swapped sensors, from the joints they share and the left-right order of the hips.

The acceleration of a joint centre computed from both sides agrees only if the two sensors share that joint.
So every plausible mislabelling is scored by the joints it implies. Swapping whole legs leaves the joints
unchanged; it is detected from the positions of the hips to the left and right of the direction of the feet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from typing import Final, TypeVar

import numpy as np

from sagittal.core.agreement.joints import LEG_JOINTS, list_worn_joints
from sagittal.core.agreement.labels import sort_by_joints
from sagittal.core.agreement.mirrored import find_mirrored
from sagittal.core.agreement.params import ExchangeParams, JointParams
from sagittal.core.agreement.strides import find_swings
from sagittal.core.agreement.terms import SensorMotion, SensorTerms, TermsPart, cut_terms
from sagittal.core.agreement.windows import JointWindows, compare_at_joint
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Floats, Segment
from sagittal.core.rotation import find_lengths, rotate

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
    """Evidence of the joints about the segment labels.

    Parameters
    ----------
    swap : swap to be undone, empty if the declared labels are right. ratio : misfit of the declared labels
        over that of the best alternative. cosine : between the hip line and the right-hand side of the
        walking direction, for the best labels; None if undetermined.
    mixed_up : segment → declared segment of its sensor, if labels are wrong in a way that is not a common
        swap; reported for confirmation, not corrected. mirrored : sensors with all accelerometer signs
        inverted; not corrected either.
    """

    swap: Swap
    ratio: float
    cosine: float | None
    mixed_up: Mapping[Segment, Segment] = field(default_factory=dict)
    mirrored: frozenset[Segment] = frozenset()


def find_exchange(
    terms: Mapping[Segment, SensorTerms],
    joints: Sequence[JointWindows],
    rate_hz: float,
    joint_params: JointParams,
    params: ExchangeParams,
) -> SensorExchange:
    """Check the declared labels on the first minute of walking.

    Parameters
    ----------
    terms : of all leg sensors and the pelvis, for at least `over_s` from the first window on. joints : for
        the declared labels, over the whole recording.
    """
    first = min((w.start_s for w in joints), default=np.inf)
    if len(joints) < 2 or first == np.inf:
        return SensorExchange((), 0.0, None)
    start = max(0.0, first)
    part = {s: cut_terms(x, start, start + params.over_s) for s, x in terms.items()}
    compared: dict[frozenset[Segment], JointWindows] = {
        frozenset((a, b)): compare_at_joint((a, b), part[a], part[b], joint_params)
        for a, b in combinations(part, 2)
    }
    if not all(len(compared[frozenset((w.first, w.second))].t_s) for w in joints):
        # a leg that swings alone says nothing of the other: labels are compared where all joints move
        return SensorExchange((), 0.0, None)
    swap, ratio = choose_labels(compared, params)
    misfits = _misfits(compared)
    rates = {s: float(np.sqrt((x.motion.rate**2).sum(axis=1).mean())) for s, x in part.items()}
    order = sort_by_joints(misfits, rates, params.calmest)
    mirrored, gain = find_mirrored(part, misfits, list_worn_joints(part), joint_params, params)
    alternative_gain = max(len(joints) * float(np.log(max(ratio, 1.0))), 0.0 if order is None else order.gain)
    if mirrored and gain > alternative_gain + np.log(params.mirrored):
        return SensorExchange((), float(np.exp(gain / len(joints))), None, mirrored=mirrored)
    if order is not None and order.is_clear(_score(misfits, swap), params.ratio, params.distinct):
        moved = {s: part[x] for s, x in order.stated_for.items()}
        cosine = _compare_hips_of(moved, rate_hz, joint_params, params)
        sure = cosine is not None and abs(cosine) > -params.cosine
        best_labels = order.exchange_legs() if cosine is not None and cosine < 0.0 else order.stated_for
        return SensorExchange((), order.stated / order.misfit, cosine, best_labels if sure else {})
    cosine = _compare_hips_of(undo_exchange(swap, part), rate_hz, joint_params, params)
    return judge_legs(swap, ratio, cosine, params)


def _compare_hips_of(
    terms: Mapping[Segment, TermsPart], rate_hz: float, joint_params: JointParams, params: ExchangeParams
) -> float | None:
    chains = {
        (a, b): compare_at_joint((a, b), terms[a], terms[b], joint_params) for a, b in list_worn_joints(terms)
    }
    return compare_hips({s: x.motion for s, x in terms.items()}, chains, rate_hz, params)


def choose_labels(
    compared: Mapping[frozenset[Segment], JointWindows], params: ExchangeParams
) -> tuple[Swap, float]:
    """The labels under which the joints fit best, and the misfit of the declared ones over theirs.

    Parameters
    ----------
    compared : sensor pairs for every joint under every labelling of `SWAPS`, by declared label.
    """
    misfits = _misfits(compared)
    segments = frozenset().union(*compared)
    stated = _score(misfits, ())
    possible = [x for x in SWAPS if all(s in segments for pair in x for s in pair)]
    scores = {x: _score(misfits, x) for x in possible}
    best = min(scores, key=lambda x: scores[x], default=())
    ratio = stated / scores[best] if best else 0.0
    return best if ratio > params.ratio else (), ratio


def _misfits(compared: Mapping[frozenset[Segment], JointWindows]) -> dict[frozenset[Segment], float]:
    """Median misfit of every pair that has windows."""
    return {k: float(np.median(np.minimum(w.residual, WORST))) for k, w in compared.items() if len(w.t_s)}


def judge_legs(swap: Swap, ratio: float, cosine: float | None, params: ExchangeParams) -> SensorExchange:
    """Add swapped legs to the best labels if the hips are in the wrong left-right order."""
    if cosine is not None and cosine < params.cosine:
        swap = _simplify((*swap, *LEGS))
    return SensorExchange(swap, ratio, cosine)


def undo_exchange(swap: Swap, by_segment: Mapping[Segment, Thing]) -> dict[Segment, Thing]:
    """Reassign items to the segments they belong to; if one of two sensors is absent, the other moves
    alone.
    """
    out = dict(by_segment)
    for a, b in swap:
        if a in out and b in out:
            out[a], out[b] = out[b], out[a]
        elif a in out:
            out[b] = out.pop(a)
        elif b in out:
            out[a] = out.pop(b)
    return out


def _score(misfits: Mapping[frozenset[Segment], float], swap: Swap) -> float:
    """Geometric mean of the joint misfits under a labelling, so that relative misfits count: ankles fit
    best.
    """
    name = {s: s for joint in LEG_JOINTS for s in joint}
    for a, b in swap:
        name[a], name[b] = b, a
    joint_misfits = [misfits.get(frozenset((name[a], name[b]))) for a, b in LEG_JOINTS]
    available = [x for x in joint_misfits if x is not None]
    return float(np.exp(np.mean(np.log(available)))) if available else np.inf


def _simplify(swap: Swap) -> Swap:
    """Pairs equivalent to several consecutive swaps, with each segment at most once."""
    moved_to = undo_exchange(swap, {s: s for pair in swap for s in pair})
    return tuple((a, b) for a, b in moved_to.items() if a < b and moved_to[b] == a)


def compare_hips(
    motions: Mapping[Segment, SensorMotion],
    joints: Mapping[tuple[Segment, Segment], JointWindows],
    rate_hz: float,
    params: ExchangeParams,
) -> float | None:
    """Cosine between the line from the left to the right hip and the right-hand side of the walking
    direction.

    The displacement of a foot over a swing is rotated into the level frame of the pelvis through the joints.

    Parameters
    ----------
    motions, joints : by the best labels; window times are relative to the first sample.
    """
    spoken = {joint: w for joint, w in joints.items() if len(w.t_s)}
    hips = [w for joint, w in spoken.items() if "pelvis" in joint]
    if any(np.median(w.residual) > params.worst_residual for w in hips):
        return None
    left, right = (spoken.get(("pelvis", THIGH[side])) for side in SIDES)
    if left is None or right is None:
        return None
    line = np.median(right.place_in("pelvis"), axis=0) - np.median(left.place_in("pelvis"), axis=0)
    cosines: list[float] = []
    for side in SIDES:
        thigh, shank, foot = THIGH[side], SHANK[side], FOOT[side]
        chain = [spoken.get(joint) for joint in (("pelvis", thigh), (thigh, shank), (shank, foot))]
        whole = [w for w in chain if w is not None]
        if len(whole) == len(chain):
            cosines += _cosines(motions, whole, line, rate_hz, params)
    return float(np.median(cosines)) if len(cosines) >= LEAST_SAYING else None


def _cosines(
    motions: Mapping[Segment, SensorMotion],
    chain: Sequence[JointWindows],
    line: Floats,
    rate_hz: float,
    params: ExchangeParams,
) -> list[float]:
    """One cosine per swing of a leg."""
    foot, shank = motions[chain[-1].second], motions[chain[-1].first]
    speed, level, pelvis = find_lengths(foot.rate), foot.level, motions["pelvis"].q
    swings, cosines = find_swings(shank.rate, rate_hz), []
    for a, b in pairwise(swings):
        if b - a > LONGEST_SWING_S * rate_hz or b - a < 5:
            continue
        middle = 0.5 * (a + b) / rate_hz
        turn = sum(float(w.turn[int(np.argmin(np.abs(w.t_s - middle)))]) for w in chain)
        # from mid-swing to mid-swing: constant errors out, zero velocity where the foot is quietest
        h = level[:2, a:b] - level[:2, a:b].mean(axis=1, keepdims=True)
        v = np.cumsum(h, axis=1) / rate_hz
        way = (v - v[:, [int(np.argmin(speed[a:b]))]]).sum(axis=1) / rate_hz
        if np.linalg.norm(way) < params.least_way_m:
            continue
        c, s = np.cos(turn), np.sin(turn)
        ahead = np.array([c * way[0] - s * way[1], s * way[0] + c * way[1]])
        hip_line = rotate(pelvis[(a + b) // 2], line)[:2]
        size = np.linalg.norm(hip_line) * np.linalg.norm(ahead)
        cosines.append(float((hip_line[0] * ahead[1] - hip_line[1] * ahead[0]) / max(size, 1e-9)))
    return cosines
