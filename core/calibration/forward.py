"""Which way is forward in every sensor, from all that speaks of it at once, and how certain that is.

Each measure of a forward axis is right to within its own spread, or wrong altogether: a von Mises density
mixed with a uniform one. Some measures are of one sensor, some of two: the sensors beside a joint see its one
acceleration, so they know how they are turned against each other, and left mirrors right. The posterior is
worked out on the circle, exactly, along the chain feet, shanks, thighs, pelvis
(docs/science/calibration.md, "Forward by likelihood").
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
    """How sure each measure is (docs/science/calibration.md, "Forward by likelihood").

    Parameters
    ----------
    *_sd : spread where it is right, rad. *_doubt : probability that it is wrong altogether. velocity_error :
    across the way after the drift is taken off, m/s: a slow walk's direction is less sure. axis_doubt : at
    least, of the acceleration's axis; else what its share leaves to the other axis. mirror_sd : left against
    right. tell_sd : a forward axis that is less sure is told.
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
    """What one measure says of one forward axis.

    Parameters
    ----------
    angle : of the axis in the sensor's rest world, rad. sd : its spread where it is right, rad. doubt :
    probability that it is wrong altogether, before the others are heard.
    """

    source: MeasureName
    angle: float
    sd: float
    doubt: float


@dataclass(frozen=True)
class JointMeasure:
    """By how much the proximal sensor's forward axis exceeds the distal one's, as their joint says.

    Parameters
    ----------
    turn : rad, from rest world to rest world. sd, doubt : as of `ForwardMeasure`.
    """

    proximal: Segment
    distal: Segment
    turn: float
    sd: float
    doubt: float


@dataclass(frozen=True)
class ForwardVote:
    """A measure after all were heard.

    Parameters
    ----------
    angle : rad in the sensor's rest world. share : probability that it is right, given the result.
    """

    source: MeasureName
    angle: float
    share: float


@dataclass(frozen=True)
class WeighedForward:
    """The forward axis of one sensor.

    Parameters
    ----------
    angle : the most probable one in the sensor's rest world, rad. sd : within so much of it lies 68 % of the
    probability of its half circle, rad: the standard deviation of a normal one, and not blown up by a small
    chance of anything.
    """

    angle: float
    sd: float
    votes: tuple[ForwardVote, ...]


def weigh_forward_axes(
    measures: Mapping[Segment, Sequence[ForwardMeasure]],
    joints: Sequence[JointMeasure],
    mirrors: Mapping[Segment, ForwardMeasure],
) -> dict[Segment, WeighedForward]:
    """Weigh all measures of all forward axes.

    Parameters
    ----------
    measures : segment → those of itself. joints : those of two sensors. mirrors : segment → its main axis of
    turning; left and right are off forward by the same angle the other way round.

    Returns
    -------
    Segment → the most probable angle, its deviation, and every vote.
    """
    heard = [j for j in joints if j.proximal in measures and j.distal in measures]
    found = {s: _locate(p) for s, p in _find_marginals(measures, heard, mirrors) if s in measures}
    return {
        s: WeighedForward(angle, sd, tuple(_hear(s, measures[s], heard, mirrors, found)))
        for s, (angle, sd) in found.items()
    }


def _spread(off: Floats, sd: float, doubt: float) -> Floats:
    """Density at these deviations in rad: von Mises, or with probability `doubt` anything."""
    kappa = 1.0 / max(sd, NARROWEST) ** 2
    # for κ of this size the von Mises density is √(κ/2π) exp(κ (cos x − 1)) to within 1 %
    right = np.sqrt(kappa / (2.0 * pi)) * np.exp(kappa * (np.cos(off) - 1.0))
    return np.asarray((1.0 - doubt) * right + doubt / (2.0 * pi))


def _find_marginals(
    measures: Mapping[Segment, Sequence[ForwardMeasure]],
    joints: Sequence[JointMeasure],
    mirrors: Mapping[Segment, ForwardMeasure],
) -> Iterator[tuple[Segment, Floats]]:
    """Every sensor's posterior (cells,), unnormalised: sums over all the others (sum-product, exact).

    Left and right of a level are one pair of angles, so that the chain has no loop. A sensor outside it, on
    the chest, has no joint here to any other and is heard alone.
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
        found = find_links(level)
        up.append(_scale(pair if found is None else pair * (found[0] @ up[-1] @ found[1].T)))
    hips, pelvis, down = find_links(LEVELS[-1]), own("pelvis"), OPEN
    if hips is None:
        yield "pelvis", pelvis
    else:
        yield "pelvis", pelvis * ((hips[0] @ up[-1]) * hips[1]).sum(axis=1)
        down = _scale(hips[0].T @ (pelvis[:, None] * hips[1]))
    for i in reversed(range(len(LEVELS))):
        left, right = LEVELS[i]["left"], LEVELS[i]["right"]
        both = up[i] * down
        yield left, both.sum(axis=1)
        yield right, both.sum(axis=0)
        if i:
            found = find_links(LEVELS[i - 1])
            down = OPEN if found is None else _scale(found[0].T @ (pairs[i] * down) @ found[1])
    chained = {"pelvis", *(s for level in LEVELS for s in level.values())}
    for outside in measures.keys() - chained:
        yield outside, own(outside)


def _link(joint: JointMeasure) -> Floats:
    """Density (proximal cells, distal cells) of two angles beside a joint."""
    return _spread(ANGLES[:, None] - ANGLES - joint.turn, joint.sd, joint.doubt)


def _mirror(left: ForwardMeasure, right: ForwardMeasure) -> Floats:
    """Density (left cells, right cells): what one side's axis turns inward, the other's does."""
    sd, doubt = max(left.sd, right.sd), max(left.doubt, right.doubt)
    return _spread(ANGLES[:, None] + ANGLES - left.angle - right.angle, sd, doubt)


def _scale(density: Floats) -> Floats:
    return np.asarray(density / density.max())


def _locate(density: Floats) -> tuple[float, float]:
    """The mean around the highest peak, rad, and the deviation from it that holds 68 % of all."""
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
    found: Mapping[Segment, tuple[float, float]],
) -> Iterator[ForwardVote]:
    """What each measure says of this axis, the others taken as they were found."""
    angle = found[segment][0]

    def vote(source: MeasureName, says: float, sd: float, doubt: float) -> ForwardVote:
        wrong = doubt / (2.0 * pi)
        share = 1.0 - wrong / float(_spread(np.array(says - angle), sd, doubt))
        return ForwardVote(source, wrap_angle(says), share)

    for m in measures:
        yield vote(m.source, m.angle, m.sd, m.doubt)
    for j in joints:
        if segment == j.proximal:
            yield vote("distal_joint", found[j.distal][0] + j.turn, j.sd, j.doubt)
        elif segment == j.distal:
            yield vote("proximal_joint", found[j.proximal][0] - j.turn, j.sd, j.doubt)
    other = next((p[o] for p in LEVELS for s, o in SIDE_PAIRS if p[s] == segment), None)
    if other is not None and other in found and segment in mirrors and other in mirrors:
        own, theirs = mirrors[segment], mirrors[other]
        says = own.angle + theirs.angle - found[other][0]
        yield vote("mirror", says, max(own.sd, theirs.sd), max(own.doubt, theirs.doubt))
