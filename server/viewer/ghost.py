"""Overlay of another walk on the avatar, at the same phase of a stride and in the same place.

Two walks share no time axis. Each included stride of the avatar is assigned a stride of the other visit, in
order and cyclically; between contacts time is scaled by phase. A walk defined by curves is shown at the
phases of both legs. There is no ghost outside such strides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core import rotation
from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.server.viewer.body_parts import PartName
from sagittal.server.viewer.layout import FigureLayout, MeshBatch
from sagittal.server.viewer.motion import GhostMotion, ReplayMotion
from sagittal.server.viewer.reference import SEGMENTS, ReferenceWalk
from sagittal.server.viewer.steps import Single

SPAN_S: Final = 1.0
"""Time over which the path gives the walking direction: about one stride, to average out sway."""

PHASES: Final = 100
"""Phase steps of a walk defined by curves, as many as its curves have."""

STANDS_M: Final = 0.15
"""A shorter path in that time has no direction; on a treadmill the initial heading is used instead."""


def match_ghost(
    figure: ReplayMotion, strides: Strides, walk: ReplayMotion, other_strides: Strides
) -> GhostMotion | None:
    """Match another visit to an avatar; None if no side has included strides in both.

    Left strides determine the match; right ones are used where there is no left one, as at the ends of a
    walk.
    """
    frames = np.full(len(figure.t_s), -1, np.int64)
    for side in SIDES:
        mine = [s for s in strides.strides if s.side == side and s.excluded_reason is None]
        theirs = [s for s in other_strides.strides if s.side == side and s.excluded_reason is None]
        if mine and theirs:
            frames = np.where(frames < 0, _frames(figure.t_s, mine, walk.t_s, theirs), frames)
    indices = np.maximum(frames, 0)
    frames[~walk.valid[indices]] = -1
    if not (frames >= 0).any():
        return None
    turn = find_heading(figure) - find_heading(walk)[indices]
    return _lay_over(figure, walk.batches, walk.root, frames, turn)


def match_reference(figure: ReplayMotion, strides: Strides, walk: ReferenceWalk) -> GhostMotion | None:
    """Match a walk defined by curves to an avatar; None if it has no included stride."""
    steps = np.stack([_count_steps(figure.t_s, strides, side) for side in SIDES], axis=1)
    pairs, frames = np.unique(steps, axis=0, return_inverse=True)
    frames = np.where((steps >= 0).any(axis=1), frames.reshape(-1), -1)
    if not (frames >= 0).any():
        return None
    # each pair of phases is posed once, independent of the length of the trial
    posed = [
        walk.at(
            {side: k / PHASES if k >= 0 else None for side, k in zip(SIDES, pair, strict=True)},
            (0.0, 0.0),
            0.0,
        )
        or walk.pose(0, 0, (0.0, 0.0), 0.0)
        for pair in pairs.tolist()
    ]
    q, p = (np.array(x) for x in zip(*posed, strict=True))
    layout = FigureLayout(SEGMENTS, figure.body, "")
    still = np.zeros((len(pairs), 2), np.float32)
    return _lay_over(figure, layout.divide(layout.place(q, p)), still, frames, find_heading(figure))


def _lay_over(
    figure: ReplayMotion,
    batches: Mapping[PartName, MeshBatch],
    root: Single,
    frames: NDArray[np.int64],
    turn: Floats,
) -> GhostMotion:
    """Rotate a walk of n frames by `turn` (m,) rad about its root (n, 2) and move it to the avatar's root."""
    indices = np.maximum(frames, 0)
    about = rotation.about(2, turn)
    moved = rotation.rotate(about, _lift(root[indices]))
    way = (_lift(figure.root) - moved)[:, None]
    about = about[:, None]

    def turned(points: Single) -> Floats:
        return rotation.rotate(about, points.astype(np.float64))

    ghost_batches = {
        name: replace(
            batch,
            wxyz=rotation.multiply(about, batch.wxyz[indices].astype(np.float64)).astype(np.float32),
            position=(turned(batch.position[indices]) + way).astype(np.float32),
        )
        for name, batch in batches.items()
        if batch.ghostly
    }
    return GhostMotion(ghost_batches, frames)


def find_heading(motion: ReplayMotion) -> Floats:
    """Return the direction of walking in rad at each frame (m,), from the path of the root."""
    step = float(motion.t_s[1] - motion.t_s[0]) if len(motion.t_s) > 1 else SPAN_S
    half = max(1, round(SPAN_S / 2 / step))
    i = np.arange(len(motion.t_s))
    way = motion.root[np.minimum(i + half, len(i) - 1)] - motion.root[np.maximum(i - half, 0)]
    far = np.hypot(way[:, 0], way[:, 1]) >= STANDS_M
    return np.where(far, np.arctan2(way[:, 1], way[:, 0]), motion.facing).astype(np.float64)


def _frames(
    t_s: Floats, mine: Sequence[Stride], other_t_s: Floats, theirs: Sequence[Stride]
) -> NDArray[np.int64]:
    frames = np.full(len(t_s), -1, np.int64)
    for k, stride in enumerate(mine):
        like = theirs[k % len(theirs)]
        inside = np.flatnonzero((t_s >= stride.start_s) & (t_s < stride.end_s))
        phase = (t_s[inside] - stride.start_s) / (stride.end_s - stride.start_s)
        times = like.start_s + phase * (like.end_s - like.start_s)
        upper = np.clip(np.searchsorted(other_t_s, times), 1, len(other_t_s) - 1)
        nearer = times - other_t_s[upper - 1] < other_t_s[upper] - times
        frames[inside] = upper - nearer
    return frames


def _count_steps(t_s: Floats, strides: Strides, side: Side) -> NDArray[np.int64]:
    """Phase of a side in steps of 1 / `PHASES` at each time, −1 outside its included strides."""
    steps = np.full(len(t_s), -1, np.int64)
    for stride in strides.strides:
        if stride.side == side and stride.excluded_reason is None:
            inside = (t_s >= stride.start_s) & (t_s < stride.end_s)
            phase = (t_s[inside] - stride.start_s) / (stride.end_s - stride.start_s)
            steps[inside] = np.rint(PHASES * phase)
    return steps


def _lift(place: Single) -> Floats:
    """Convert floor positions (n, 2) to points (n, 3), m."""
    return np.column_stack((place, np.zeros(len(place)))).astype(np.float64)
