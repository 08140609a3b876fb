"""Poses → the arrays a figure is drawn from, so that showing a moment is only indexing.

Everything is float32 and thinned to at most 50 frames a second. The figure is drawn where it stands in the
room; the smoothed path of its root is kept apart, so that the viewer can follow the person.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from core import rotation
from core.body.model import BodyModel
from core.body.poses import Poses
from core.body.tree import PRESETS
from core.errors import ParameterError
from core.frames import FOOT, R_NEUTRAL, SHANK, SIDES, THIGH, Bools, Floats, Segment, Side
from server.viewer import shapes
from server.viewer.colours import Tint
from server.viewer.ghost import Ghost
from server.viewer.steps import Prints, Single, Trail, prints, sole, trail

FRAME_RATE = 50.0
"""Frames kept per second; the page asks for about 30."""

ROOT_WINDOW_S = 1.2
"""The view follows the root averaged over about one stride: sway stays visible, the walk stays in view."""

_WORN: Mapping[str, tuple[Segment, ...]] = {"l7s_3i": PRESETS["feet_pelvis3"], "l7s_2i": PRESETS["feet2"]}
"""Method → segments whose sensors it uses, where it gives poses of others too."""

# Stature fractions of Winter (Biomechanics and Motor Control of Human Movement, fig 4.1) for the parts that
# carry no sensor and are drawn for orientation only; stature itself is thigh / 0.245.
_THIGH_FRACTION = 0.245
_SHOULDER_ABOVE_HIP = 0.288
_HEAD_ABOVE_HIP = 0.395
_HEAD_RADIUS = 0.060

Row = tuple[Floats, Floats, tuple[float, float, float], Tint, Segment]
"""Orientation, position, scale and colour role of one copy, and the segment it is part of or hangs on."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Copies of one mesh, k of them in each of m frames.

    Parameters
    ----------
    wxyz : (m, k, 4). position : (m, k, 3) m, world. scale : (k, 3). tint : k colour roles.
    measured : k, False where no sensor supports the part and the estimator alone says where it is.
    """

    mesh: shapes.Mesh
    wxyz: Single
    position: Single
    scale: Single
    tint: tuple[Tint, ...]
    measured: tuple[bool, ...]


@dataclass(frozen=True, eq=False)
class Motion:
    """A prepared walk.

    Parameters
    ----------
    t_s : (m,) s. valid : (m,) False where a sensor was lost: nothing is drawn.
    batches : name → copies of one mesh. root : (m, 2) m, smoothed path on the floor.
    toes : side → (m, 3) where the letter of that side is written.
    prints, trails : side → where that foot rested, and its way; no trails unless `placed`.
    placed : positions are estimates of where the person was in the room, not only for the eye.
    facing : heading in rad at the first valid frame. ghost : another visit laid over it, None without.
    """

    t_s: Floats
    valid: Bools
    batches: dict[str, Batch]
    root: Single
    toes: dict[Side, Single]
    prints: dict[Side, Prints]
    trails: dict[Side, Trail]
    placed: bool
    facing: float
    body: BodyModel
    ghost: Ghost | None = None

    @property
    def duration_s(self) -> float:
        """Time of the last frame, s."""
        return float(self.t_s[-1])

    @property
    def size(self) -> float:
        """Leg length relative to 0.9 m."""
        return (self.body.thigh + self.body.shank + self.body.ankle_height) / 0.9

    @property
    def measured(self) -> bool:
        """Whether sensors support every part of the figure."""
        return all(all(b.measured) for b in self.batches.values())

    def index(self, t_s: float) -> int:
        """Frame nearest to a time; times outside are held at the ends."""
        i = int(np.searchsorted(self.t_s, t_s))
        if i == 0:
            return 0
        if i == len(self.t_s):
            return i - 1
        return i if self.t_s[i] - t_s < t_s - self.t_s[i - 1] else i - 1


def prepare(poses: Poses) -> Motion:
    """Lay out everything that is drawn, for all frames at once (about 0.1 s for 10 min; call in a thread).

    Raises
    ------
    ParameterError
        `no_figure` when no segment has a pose.
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
    worn = _WORN.get(poses.method, tuple(q))
    feet = [side for side in SIDES if FOOT[side] in q]
    soles = {side: sole(p[FOOT[side]], q[FOOT[side]], poses.body) for side in feet}
    placed = poses.method != "stance_foot_anchor"
    return Motion(
        t_s=t_s,
        valid=valid,
        batches={
            "bones": _bones(q, p, poses.body, worn),
            "shoes": _shoes(q, p, poses.body, worn),
            "balls": _balls(q, p, poses.body, worn),
        },
        root=_smooth(root[:, :2], max(1, round(ROOT_WINDOW_S * rate))).astype(np.float32),
        toes={side: _toe(q[FOOT[side]], p[FOOT[side]], poses.body) for side in feet},
        prints={
            side: prints(t_s, valid, poses.contact[FOOT[side]][keep], soles[side], q[FOOT[side]])
            for side in feet
            if FOOT[side] in poses.contact
        },
        trails={side: trail(t_s, valid, soles[side]) for side in feet if placed},
        placed=placed,
        facing=float(rotation.yaw(q[lead][first])),
        body=poses.body,
    )


def _bones(
    q: dict[Segment, Floats], p: dict[Segment, Floats], body: BodyModel, worn: Collection[Segment]
) -> Batch:
    """Thighs, shanks and the trunk as rounded cones from the segment's origin."""
    down = rotation.about(0, np.pi / 2)  # mesh +z → segment −y, towards the distal joint
    up = rotation.about(0, -np.pi / 2)
    rows: list[Row] = []
    for side in SIDES:
        for segment, radius, length in (
            (THIGH[side], 0.058, body.thigh),
            (SHANK[side], 0.045, body.shank),
        ):
            if segment in q:
                turn = rotation.multiply(q[segment], down)
                rows.append((turn, p[segment], (radius, radius, length), side, segment))
    if "pelvis" in q:
        stature = body.thigh / _THIGH_FRACTION
        trunk = _trunk(q)
        shoulders = p["pelvis"] + rotation.rotate(trunk, np.array([0.0, _SHOULDER_ABOVE_HIP * stature, 0.0]))
        length = (_SHOULDER_ABOVE_HIP - 0.03) * stature
        # the cone's axes are segment x, z, y: depth, width, length
        rows.append((rotation.multiply(trunk, down), shoulders, (0.075, 0.115, length), "body", "pelvis"))
        neck = (_HEAD_ABOVE_HIP - _SHOULDER_ABOVE_HIP) * stature
        rows.append((rotation.multiply(trunk, up), shoulders, (0.042, 0.042, neck), "body", "pelvis"))
    return _batch(shapes.bone(), rows, worn)


def _shoes(
    q: dict[Segment, Floats], p: dict[Segment, Floats], body: BodyModel, worn: Collection[Segment]
) -> Batch:
    rows: list[Row] = [
        (q[FOOT[side]], p[FOOT[side]], (1.0, 1.0, 1.0), side, FOOT[side]) for side in SIDES if FOOT[side] in q
    ]
    return _batch(shapes.shoe(body.foot, body.ankle_height), rows, worn)


def _balls(
    q: dict[Segment, Floats], p: dict[Segment, Floats], body: BodyModel, worn: Collection[Segment]
) -> Batch:
    """Hips, knees and ankles, the pelvis and the head."""
    rows: list[Row] = []
    for side in SIDES:
        for segment, radius in ((THIGH[side], 0.065), (SHANK[side], 0.054), (FOOT[side], 0.040)):
            if segment in q:
                rows.append((q[segment], p[segment], (radius, radius, radius), "joint", segment))
    if "pelvis" in q:
        stature = body.thigh / _THIGH_FRACTION
        rows.append((q["pelvis"], p["pelvis"], (0.075, 0.075, body.hip_width / 2 + 0.02), "body", "pelvis"))
        trunk = _trunk(q)
        head = p["pelvis"] + rotation.rotate(trunk, np.array([0.01, _HEAD_ABOVE_HIP * stature, 0.0]))
        r = _HEAD_RADIUS * stature
        rows.append((trunk, head, (r * 0.92, r * 1.15, r * 0.82), "body", "pelvis"))
    return _batch(shapes.ball(), rows, worn)


def _trunk(q: dict[Segment, Floats]) -> Floats:
    """Orientation of the chest; without a sensor there, upright and facing as the pelvis does."""
    if "chest" in q:
        return q["chest"]
    return rotation.multiply(rotation.about(2, rotation.yaw(q["pelvis"])), rotation.from_matrix(R_NEUTRAL))


def _batch(mesh: shapes.Mesh, rows: list[Row], worn: Collection[Segment]) -> Batch:
    frames = len(rows[0][0]) if rows else 0
    wxyz = np.zeros((frames, len(rows), 4), np.float32)
    position = np.zeros((frames, len(rows), 3), np.float32)
    for k, (turn, place, *_) in enumerate(rows):
        wxyz[:, k], position[:, k] = turn, place
    return Batch(
        mesh,
        wxyz,
        position,
        scale=np.array([scale for _, _, scale, _, _ in rows], np.float32).reshape(-1, 3),
        tint=tuple(tint for *_, tint, _ in rows),
        measured=tuple(segment in worn for *_, segment in rows),
    )


def _toe(q: Floats, p: Floats, body: BodyModel) -> Single:
    at = np.array([0.75 * body.foot + 0.05, -0.5 * body.ankle_height, 0.0])
    return (p + rotation.rotate(q, at)).astype(np.float32)


def _smooth(path: Floats, window: int) -> Floats:
    """Moving average over `window` samples, the ends held."""
    half = window // 2
    padded = np.concatenate((np.repeat(path[:1], half + 1, 0), path, np.repeat(path[-1:], half, 0)))
    total = np.cumsum(padded, axis=0)
    return (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)


def _finite(a: Floats, instead: tuple[float, ...]) -> Floats:
    """Replace rows before the first valid sample that are not finite; they are never drawn."""
    bad = ~np.isfinite(a).all(axis=1)
    if bad.any():
        a = a.copy()
        a[bad] = instead
    return a
