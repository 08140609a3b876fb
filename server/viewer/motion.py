"""Precomputed arrays of an avatar, so that showing a frame only requires indexing.

Everything is float32 and reduced to at most 50 frames per second. The avatar is placed in room coordinates;
the smoothed path of its root is stored separately, so that the camera can follow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from sagittal.core import rotation
from sagittal.core.body.model import BodyModel
from sagittal.core.body.poses import Poses
from sagittal.core.errors import ParameterError
from sagittal.core.estimators import BY_METHOD
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Bools, Floats, Segment, Side
from sagittal.server.viewer.body_parts import PartName
from sagittal.server.viewer.layout import FigureLayout, MeshBatch
from sagittal.server.viewer.steps import FootPrints, FootTrail, Single, find_prints, lay_trail

FRAME_RATE = 50.0
"""Frames kept per second; the page asks for about 30."""

ROOT_WINDOW_S = 1.2
"""The view follows the root averaged over about one stride: sway remains visible, the walk stays in view."""

GhostName = Literal["visit", "norm", "left", "right"]
"""Another visit, the norm at this speed, or the mean of one side for both legs."""

LOWER_BODY: Final[tuple[Segment, ...]] = (
    "pelvis",
    *(s[side] for side in SIDES for s in (THIGH, SHANK, FOOT)),
)
"""Segments of a complete avatar."""

FOR_THE_EYE = frozenset(e.method for e in BY_METHOD.values() if not e.in_room)
"""Methods whose positions are for illustration only."""


@dataclass(frozen=True, eq=False)
class ReplayMotion:
    """A prepared walk.

    Parameters
    ----------
    t_s : (m,) s. valid : (m,) False where a sensor was lost; such frames are not drawn.
    batches : name → instances of one mesh. segments : those with a pose.
    root : (m, 2) m, smoothed path on the floor.
    prints, trails : side → footprints and path of that foot; no trails unless `placed`.
    placed : positions are estimates in the room, rather than for illustration only.
    facing : heading in rad at the first valid frame. ghosts : name → function that returns a walk for
        overlay, None if unavailable; slow the first time.
    """

    t_s: Floats
    valid: Bools
    batches: Mapping[PartName, MeshBatch]
    segments: tuple[Segment, ...]
    root: Single
    prints: dict[Side, FootPrints]
    trails: dict[Side, FootTrail]
    placed: bool
    facing: float
    body: BodyModel
    ghosts: Mapping[GhostName, Callable[[], GhostMotion | None]] = field(default_factory=dict)

    @property
    def duration_s(self) -> float:
        """Time of the last frame, s."""
        return float(self.t_s[-1])

    @property
    def size(self) -> float:
        """Leg length relative to 0.9 m."""
        return (self.body.thigh + self.body.shank + self.body.ankle_height) / 0.9

    @property
    def hidden(self) -> tuple[Segment, ...]:
        """Segments of the lower body without a pose, which are not drawn."""
        return tuple(s for s in LOWER_BODY if s not in self.segments)

    @property
    def measured(self) -> bool:
        """Whether all parts of the avatar are measured by sensors."""
        return all(all(b.measured) for b in self.batches.values())

    def index(self, t_s: float) -> int:
        """Index of the frame nearest to a time, clipped to the range."""
        i = int(np.searchsorted(self.t_s, t_s))
        if i == 0:
            return 0
        if i == len(self.t_s):
            return i - 1
        return i if self.t_s[i] - t_s < t_s - self.t_s[i - 1] else i - 1


@dataclass(frozen=True, eq=False)
class GhostMotion:
    """Another walk overlaid on an avatar, with the same position and direction in each frame.

    Parameters
    ----------
    batches : name → instances of one mesh in the m frames of the avatar, for the parts of a ghost.
    frames : (m,) corresponding frame of the other walk, −1 if none.
    """

    batches: Mapping[PartName, MeshBatch]
    frames: NDArray[np.int64]


def prepare_motion(poses: Poses) -> ReplayMotion:
    """Lay out everything for all frames at once (about 0.1 s for 10 min; call in a thread).

    Raises
    ------
    ParameterError
        `no_figure` if no segment has a pose.
    """
    if not poses.q or len(poses.t_s) == 0:
        raise ParameterError(
            "no_figure", "No figure: it needs the pelvis and one whole leg (thigh, shank, foot)."
        )
    keep = slice(None, None, max(1, round(poses.rate_hz / FRAME_RATE)))
    q = {s: np.asarray(a[keep], np.float64) for s, a in poses.q.items()}
    p = {s: np.asarray(a[keep], np.float64) for s, a in poses.p.items()}
    valid = poses.valid[keep] & np.all(
        [np.isfinite(a).all(axis=1) for a in (*q.values(), *p.values())], axis=0
    )
    hold = np.maximum.accumulate(np.where(valid, np.arange(len(valid)), 0))
    q = {s: _finite(a[hold], (1.0, 0.0, 0.0, 0.0)) for s, a in q.items()}
    p = {s: _finite(a[hold], (0.0, 0.0, 0.0)) for s, a in p.items()}
    t_s = poses.t_s[keep]
    first = int(np.argmax(valid))
    lead: Segment = "pelvis" if "pelvis" in q else next(iter(q))
    root = p["pelvis"] if "pelvis" in p else np.mean(list(p.values()), axis=0)
    rate = poses.rate_hz / (keep.step or 1)
    layout = FigureLayout(tuple(q), poses.body, poses.method)
    placed = layout.place(*(np.stack([pose_arrays[s] for s in q], axis=1) for pose_arrays in (q, p)))
    in_room = poses.method not in FOR_THE_EYE
    return ReplayMotion(
        t_s=t_s,
        valid=valid,
        batches=layout.divide(placed),
        segments=tuple(q),
        root=_smooth(root[:, :2], max(1, round(ROOT_WINDOW_S * rate))).astype(np.float32),
        prints={
            side: find_prints(t_s, valid, poses.contact[FOOT[side]][keep], path, q[FOOT[side]])
            for side, path in placed.soles.items()
            if FOOT[side] in poses.contact
        },
        trails={side: lay_trail(t_s, valid, path) for side, path in placed.soles.items() if in_room},
        placed=in_room,
        facing=float(rotation.yaw(q[lead][first])),
        body=poses.body,
    )


def _smooth(path: Floats, window: int) -> Floats:
    """Moving average over `window` samples, with constant extension at the ends."""
    half = window // 2
    padded = np.concatenate((np.repeat(path[:1], half + 1, 0), path, np.repeat(path[-1:], half, 0)))
    total = np.cumsum(padded, axis=0)
    return (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)


def _finite(a: Floats, instead: tuple[float, ...]) -> Floats:
    """Replace non-finite rows before the first valid sample, which are never drawn."""
    bad = ~np.isfinite(a).all(axis=1)
    if bad.any():
        a = a.copy()
        a[bad] = instead
    return a
