"""Joint estimation of the forward axes of all sensors from all evidence, with their uncertainty.

Each measure of a forward axis is either right to within its own spread or completely wrong: a von Mises
density mixed with a uniform one. Some measures concern one sensor, some two: the two sensors at a joint
observe the same joint acceleration, which gives their relative heading, and left mirrors right. The posterior
is computed exactly on the circle, along the chain feet, shanks, thighs, pelvis (docs/science/calibration.md,
"Forward by likelihood").
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import pi, radians
from typing import Final, Literal

import numpy as np

from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Floats, Segment, Side
from sagittal.core.rotation import wrap_angle

MeasureName = Literal[
    "strides", "velocity", "start_velocity", "acceleration", "gyro_pca", "mirror", "declared", "hip_swing",
    "trunk_bow", "proximal_joint", "distal_joint",
]  # fmt: skip

CELLS: Final = 360
"""Cells of the circle. Densities of 1.5° and wider are summed over them as if they were integrated."""

ANGLES: Final[Floats] = np.asarray(np.arange(CELLS) * (2.0 * pi / CELLS) - pi, np.float64)

OPEN: Final[Floats] = np.ones((CELLS, CELLS))
"""Density of two angles that no joint links."""
OPEN.setflags(write=False)

NARROWEST: Final = radians(1.5)
"""No measure is taken to be surer (cells of 1°)."""

PEAK: Final = radians(30.0)
"""Half the width of a peak over which its middle is taken."""

ONE_SD: Final = 0.6827
"""Probability within one standard deviation of a normal distribution."""

SIDE_PAIRS: Final[tuple[tuple[Side, Side], ...]] = (("left", "right"), ("right", "left"))

LEVELS: Final[tuple[Mapping[Side, Segment], ...]] = (FOOT, SHANK, THIGH)
"""From the floor up; above them the pelvis."""


@dataclass(frozen=True)
class ForwardParams:
    """Reliability of each measure (docs/science/calibration.md, "Forward by likelihood").

    Parameters
    ----------
    *_sd : spread if right, rad. *_doubt : probability of being completely wrong. velocity_error_mps : lateral
    velocity error after drift removal, m/s, which makes the direction of slow walks less certain.
    axis_doubt : minimum for the acceleration axis; otherwise 1 − its share. mirror_sd : left against right.
    tell_sd : a larger uncertainty of a forward axis is reported.
    """

    strides_sd: float = radians(2.0)
    strides_doubt: float = 0.02
    velocity_sd: float = radians(3.5)
    velocity_error_mps: float = 0.03
    velocity_doubt: float = 0.1
    start_sd: float = radians(15.0)
    start_doubt: float = 0.3
    axis_sd: float = radians(6.0)
    axis_doubt: float = 0.05
    pca_sd: float = radians(10.0)
    pca_doubt: float = 0.3
    mirror_sd: float = radians(10.0)
    movement_sd: float = radians(5.0)
    movement_doubt: float = 0.05
    declared_sd: float = radians(20.0)
    declared_doubt: float = 0.05
    tell_sd: float = radians(8.0)


@dataclass(frozen=True)
class ForwardMeasure:
    """One measure of one forward axis.

    Parameters
    ----------
    angle : of the axis in the sensor's rest frame, rad. sd : its spread if right, rad. doubt : prior
    probability of being completely wrong.
    """

    source: MeasureName
    angle: float
    sd: float
    doubt: float


@dataclass(frozen=True)
class JointMeasure:
    """Heading of the proximal sensor's forward axis minus that of the distal one, as measured at their joint.

    Parameters
    ----------
    turn : rad, between the two rest frames. sd, doubt : as in `ForwardMeasure`.
    """

    proximal: Segment
    distal: Segment
    turn: float
    sd: float
    doubt: float


@dataclass(frozen=True)
class ForwardVote:
    """A measure after the joint estimation.

    Parameters
    ----------
    angle : rad in the sensor's rest frame. share : posterior probability that it is right.
    """

    source: MeasureName
    angle: float
    share: float


@dataclass(frozen=True)
class WeighedForward:
    """Estimated forward axis of one sensor.

    Parameters
    ----------
    angle : posterior mode in the sensor's rest frame, rad. sd : half width of the interval with 68 % of the
    probability of the surrounding half circle, rad: equals the standard deviation of a normal distribution
    and is robust to heavy tails.
    """

    angle: float
    sd: float
    votes: tuple[ForwardVote, ...]


def weigh_forward_axes(
    measures: Mapping[Segment, Sequence[ForwardMeasure]],
    joints: Sequence[JointMeasure],
    mirrors: Mapping[Segment, ForwardMeasure],
) -> dict[Segment, WeighedForward]:
    """Combine all measures of all forward axes.

    Parameters
    ----------
    measures : segment → its own measures. joints : measures between two sensors. mirrors : segment → its main
    rotation axis; left and right deviate from forward by the same angle in opposite directions.

    Returns
    -------
    Segment → the most probable angle, its standard deviation, and the share of every measure.
    """
    heard = [j for j in joints if j.proximal in measures and j.distal in measures]
    estimates = {s: _locate(p) for s, p in _find_marginals(measures, heard, mirrors) if s in measures}
    return {
        s: WeighedForward(angle, sd, tuple(_hear(s, measures[s], heard, mirrors, estimates)))
        for s, (angle, sd) in estimates.items()
    }


def _spread(off: Floats, sd: float, doubt: float) -> Floats:
    """Density at these deviations in rad: von Mises, mixed with a uniform one of weight `doubt`."""
    kappa = 1.0 / max(sd, NARROWEST) ** 2
    # for κ of this size the von Mises density is √(κ/2π) exp(κ (cos x − 1)) to within 1 %
    right = np.sqrt(kappa / (2.0 * pi)) * np.exp(kappa * (np.cos(off) - 1.0))
    return np.asarray((1.0 - doubt) * right + doubt / (2.0 * pi))


def _find_marginals(
    measures: Mapping[Segment, Sequence[ForwardMeasure]],
    joints: Sequence[JointMeasure],
    mirrors: Mapping[Segment, ForwardMeasure],
) -> Iterator[tuple[Segment, Floats]]:
    """Unnormalised posterior (cells,) of every sensor, marginalised over all others (exact sum-product).

    Left and right of a level form one pair of angles, so that the chain has no loop. A sensor outside it, on
    the chest, has no joint with any other and is estimated on its own.
    """
    links = {j.distal: _link(j) for j in joints}

    def own(segment: Segment) -> Floats:
        each = [_spread(ANGLES - m.angle, m.sd, m.doubt) for m in measures.get(segment, ())]
        return np.asarray(np.prod(each, axis=0)) if each else np.ones(CELLS)

    def find_links(level: Mapping[Side, Segment]) -> tuple[Floats, Floats] | None:
        left, right = (links.get(level[side]) for side in SIDES)
        if left is None and right is None:
            return None
        return OPEN if left is None else left, OPEN if right is None else right

    pairs = []
    for level in LEVELS:
        left, right = level["left"], level["right"]
        pair = own(left)[:, None] * own(right)
        if left in mirrors and right in mirrors:
            pair = pair * _mirror(mirrors[left], mirrors[right])
        pairs.append(pair)
    up = [pairs[0]]
    for level, pair in zip(LEVELS, pairs[1:], strict=False):
        link_pair = find_links(level)
        up.append(_scale(pair if link_pair is None else pair * (link_pair[0] @ up[-1] @ link_pair[1].T)))
    hips, pelvis, down = find_links(LEVELS[-1]), own("pelvis"), OPEN
    if hips is None:
        yield "pelvis", pelvis
    else:
        yield "pelvis", pelvis * ((hips[0] @ up[-1]) * hips[1]).sum(axis=1)
        down = _scale(hips[0].T @ (pelvis[:, None] * hips[1]))
    for i in reversed(range(len(LEVELS))):
        left, right = LEVELS[i]["left"], LEVELS[i]["right"]
        joint_density = up[i] * down
        yield left, joint_density.sum(axis=1)
        yield right, joint_density.sum(axis=0)
        if i:
            link_pair = find_links(LEVELS[i - 1])
            down = OPEN if link_pair is None else _scale(link_pair[0].T @ (pairs[i] * down) @ link_pair[1])
    chained = {"pelvis", *(s for level in LEVELS for s in level.values())}
    for outside in measures.keys() - chained:
        yield outside, own(outside)


def _link(joint: JointMeasure) -> Floats:
    """Density (proximal cells, distal cells) of the two angles at a joint."""
    return _spread(ANGLES[:, None] - ANGLES - joint.turn, joint.sd, joint.doubt)


def _mirror(left: ForwardMeasure, right: ForwardMeasure) -> Floats:
    """Density (left cells, right cells) under mirror symmetry: both axes are rotated inward by the same
    angle.
    """
    sd, doubt = max(left.sd, right.sd), max(left.doubt, right.doubt)
    return _spread(ANGLES[:, None] + ANGLES - left.angle - right.angle, sd, doubt)


def _scale(density: Floats) -> Floats:
    return np.asarray(density / density.max())


def _locate(density: Floats) -> tuple[float, float]:
    """Mean around the highest peak, rad, and the half width that contains 68 % of the probability."""
    p = density / density.sum()
    peak = ANGLES[int(np.argmax(p))]
    near = np.abs(wrap_angle(ANGLES - peak)) <= PEAK
    angle = float(np.angle((p[near] * np.exp(1j * ANGLES[near])).sum()))
    off = np.abs(wrap_angle(ANGLES - angle))
    # which end of an axis is ahead is decided before: only this half circle counts
    order = np.argsort(off)[: CELLS // 2]
    held = np.cumsum(p[order])
    # so many cells lie to either side of it as one
    reach = np.arange(1, len(order) + 1) * (pi / CELLS)
    return angle, float(np.interp(ONE_SD, held / held[-1], reach))


def _hear(
    segment: Segment,
    measures: Sequence[ForwardMeasure],
    joints: Sequence[JointMeasure],
    mirrors: Mapping[Segment, ForwardMeasure],
    estimates: Mapping[Segment, tuple[float, float]],
) -> Iterator[ForwardVote]:
    """Posterior share of each measure of this axis, given the estimates of the other sensors."""
    angle = estimates[segment][0]

    def vote(source: MeasureName, says: float, sd: float, doubt: float) -> ForwardVote:
        wrong = doubt / (2.0 * pi)
        share = 1.0 - wrong / float(_spread(np.array(says - angle), sd, doubt))
        return ForwardVote(source, wrap_angle(says), share)

    for m in measures:
        yield vote(m.source, m.angle, m.sd, m.doubt)
    for j in joints:
        if segment == j.proximal:
            yield vote("distal_joint", estimates[j.distal][0] + j.turn, j.sd, j.doubt)
        elif segment == j.distal:
            yield vote("proximal_joint", estimates[j.proximal][0] - j.turn, j.sd, j.doubt)
    opposite = next((p[o] for p in LEVELS for s, o in SIDE_PAIRS if p[s] == segment), None)
    if opposite is not None and opposite in estimates and segment in mirrors and opposite in mirrors:
        own, theirs = mirrors[segment], mirrors[opposite]
        says = own.angle + theirs.angle - estimates[opposite][0]
        yield vote("mirror", says, max(own.sd, theirs.sd), max(own.doubt, theirs.doubt))
