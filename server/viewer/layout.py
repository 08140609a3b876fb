"""Which copies of which mesh a figure is made of, and where each sits on its segment.

The same few rigid parts whatever the time: laid out for a whole take or for one moment alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal

import numpy as np

from core import rotation
from core.body.model import BodyModel
from core.estimators import BY_METHOD
from core.frames import FOOT, R_NEUTRAL, SEGMENTS, SHANK, SIDES, THIGH, Floats, Segment, Side
from server.viewer import shapes
from server.viewer.colours import Tint
from server.viewer.steps import Single

_WORN: Mapping[str, tuple[Segment, ...]] = {
    method: e.sensors for method, e in BY_METHOD.items() if e.sensors is not None
}
"""Method → segments whose sensors it uses, where it gives poses of others too."""

# Stature fractions of Winter (Biomechanics and Motor Control of Human Movement, fig 4.1) for the parts that
# carry no sensor and are drawn for orientation only; stature itself is thigh / 0.245.
_THIGH_FRACTION = 0.245
_SHOULDER_ABOVE_HIP = 0.288
_HEAD_ABOVE_HIP = 0.395
_HEAD_RADIUS = 0.060

_STAYS: Final = np.array([1.0, 0.0, 0.0, 0.0])
_DOWN: Final = rotation.about(0, np.pi / 2)
"""Mesh +z → segment −y, towards the distal joint."""

_UP: Final = rotation.about(0, -np.pi / 2)
_NEUTRAL: Final = rotation.from_matrix(R_NEUTRAL)

_BLOCK: Final = 512
"""Frames placed at a time: what is being worked on stays in the processor's cache."""

Name = Literal["bones", "shoes", "balls", "letters_left", "letters_right", "soles"]
"""Meshes by name, and a point of each foot: the middle of its sole."""

_BAND: Final = (0.068, 0.19)
"""Radius and length, m, of the band around the shank that carries the letter of the side."""

_SEEN_FROM: Final = np.radians(60.0)
"""From front and right, where the camera stands at first (server/viewer/room.py)."""

Vector = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class FigurePart:
    """One copy of a mesh, or a point.

    Parameters
    ----------
    segment : carries it; `trunk` : hangs on the upright trunk over that segment instead.
    turn : (4,) and at : m, in the segment's axes.
    """

    name: Name
    segment: Segment
    scale: Vector
    tint: Tint
    turn: Floats
    at: Vector
    trunk: bool = False


@dataclass(frozen=True, eq=False)
class MeshBatch:
    """Copies of one mesh, k of them in each of m frames.

    Parameters
    ----------
    wxyz : (m, k, 4). position : (m, k, 3) m, world. scale : (k, 3). tint : k colour roles.
    measured : k, False where no sensor supports the part and the estimator alone says where it is.
    ghostly : k, False for what another visit laid over it does not show: a letter and its band.
    """

    mesh: shapes.Mesh
    wxyz: Single
    position: Single
    scale: Single
    tint: tuple[Tint, ...]
    measured: tuple[bool, ...]
    ghostly: tuple[bool, ...]


@dataclass(frozen=True, eq=False)
class PlacedFigure:
    """A figure in m frames.

    Parameters
    ----------
    batches : name → copies of one mesh. soles : side → (m, 3) m, world.
    """

    batches: Mapping[str, MeshBatch]
    soles: Mapping[Side, Single]


class FigureLayout:
    """The parts of a figure.

    Parameters
    ----------
    segments : those with a pose. method : the estimator's, says which of them carry a sensor.
    """

    def __init__(self, segments: Sequence[Segment], body: BodyModel, method: str) -> None:
        self.segments = tuple(s for s in SEGMENTS if s in segments)
        self._parts = _parts(self.segments, body)
        worn = _WORN.get(method, self.segments)
        # the trunk is one carrier more, behind the segments
        self._carrier = np.array(
            [len(self.segments) if x.trunk else self.segments.index(x.segment) for x in self._parts], np.intp
        )
        # a chest carries its parts as it is turned, a heading only knows where the front is
        upright = "chest" not in self.segments
        raised = [rotation.multiply(_NEUTRAL, x.turn) if x.trunk and upright else x.turn for x in self._parts]
        offset = [
            rotation.rotate(_NEUTRAL, np.array(x.at)) if x.trunk and upright else np.array(x.at)
            for x in self._parts
        ]
        self._turn = np.array([_turning(x) for x in raised]).reshape(-1, 4, 4)
        self._at = np.array(offset, np.float64).reshape(-1, 1, 3)
        self._moved = np.flatnonzero(self._at.any(axis=(1, 2)))
        self._arm = np.array([_swinging(x) for x in self._at[self._moved, 0]]).reshape(-1, 16, 3)
        self._meshes = {
            "bones": shapes.make_bone(),
            "shoes": _shoe(body),
            "balls": shapes.make_ball(),
            "letters_left": _letter("left"),
            "letters_right": _letter("right"),
        }
        names: list[str] = [x.name for x in self._parts]
        ends = {
            name: max((k + 1 for k, x in enumerate(names) if x == name), default=0) for name in self._meshes
        }
        self._rows = {name: slice(ends[name] - names.count(name), ends[name]) for name in ends}
        self._look = {
            name: (
                np.array([x.scale for x in self._parts[rows]], np.float32).reshape(-1, 3),
                tuple(x.tint for x in self._parts[rows]),
                tuple(x.segment in worn for x in self._parts[rows]),
                tuple(x.tint != "band" and not name.startswith("letters") for x in self._parts[rows]),
            )
            for name, rows in self._rows.items()
        }
        self._soles: dict[Side, int] = {
            side: k
            for side in SIDES
            for k, x in enumerate(self._parts)
            if (x.name, x.tint) == ("soles", side)
        }

    def place(self, q: Mapping[Segment, Floats], p: Mapping[Segment, Floats]) -> PlacedFigure:
        """Place all parts; q (m, 4) and p (m, 3) of every segment of this layout."""
        turn, at = [q[s] for s in self.segments], [p[s] for s in self.segments]
        if "pelvis" in self.segments:
            turn.append(q["chest"] if "chest" in q else _facing(q["pelvis"]))
            at.append(p["pelvis"])
        frames = len(at[0])
        wxyz = np.empty((frames, len(self._parts), 4), np.float32)
        position = np.empty((frames, len(self._parts), 3), np.float32)
        for start in range(0, frames, _BLOCK):
            block = slice(start, start + _BLOCK)
            held = np.array([x[block] for x in turn])[self._carrier]
            moved = np.array([x[block] for x in at])[self._carrier]
            arms = held[self._moved]
            pairs = (arms[..., None] * arms[..., None, :]).reshape(*arms.shape[:-1], 16)
            moved += self._at
            moved[self._moved] += pairs @ self._arm
            wxyz[block], position[block] = (held @ self._turn).swapaxes(0, 1), moved.swapaxes(0, 1)
        return PlacedFigure(
            {
                name: MeshBatch(self._meshes[name], wxyz[:, rows], position[:, rows], *self._look[name])
                for name, rows in self._rows.items()
            },
            {side: position[:, k] for side, k in self._soles.items()},
        )


def _parts(segments: Sequence[Segment], body: BodyModel) -> list[FigurePart]:
    stature = body.thigh / _THIGH_FRACTION
    parts: list[FigurePart] = []

    def add(
        name: Name,
        segment: Segment,
        scale: Vector = (1.0, 1.0, 1.0),
        tint: Tint = "joint",
        turn: Floats = _STAYS,
        at: Vector = (0.0, 0.0, 0.0),
        trunk: bool = False,
    ) -> None:
        if segment in segments:
            parts.append(FigurePart(name, segment, scale, tint, turn, at, trunk))

    for side in SIDES:
        add("bones", THIGH[side], (0.058, 0.058, body.thigh), side, _DOWN)
        add("bones", SHANK[side], (0.045, 0.045, body.shank), side, _DOWN)
    radius, length = _BAND
    band = (0.0, -0.5 * (body.shank - length), 0.0)
    for side in SIDES:
        add("bones", SHANK[side], (radius, radius, length), "band", _DOWN, band)
    # the cones' axes are segment x, z, y: depth, width, length
    shoulders = (0.0, _SHOULDER_ABOVE_HIP * stature, 0.0)
    length, neck = (
        (_SHOULDER_ABOVE_HIP - 0.03) * stature,
        (_HEAD_ABOVE_HIP - _SHOULDER_ABOVE_HIP) * stature,
    )
    add("bones", "pelvis", (0.075, 0.115, length), "body", _DOWN, shoulders, trunk=True)
    add("bones", "pelvis", (0.042, 0.042, neck), "body", _UP, shoulders, trunk=True)
    for side in SIDES:
        add("shoes", FOOT[side], tint=side)
    for side in SIDES:
        for segment, r in ((THIGH[side], 0.065), (SHANK[side], 0.054), (FOOT[side], 0.040)):
            add("balls", segment, (r, r, r))
    add("balls", "pelvis", (0.075, 0.075, body.hip_width / 2 + 0.02), "body")
    r, head = _HEAD_RADIUS * stature, (0.01, _HEAD_ABOVE_HIP * stature, 0.0)
    add("balls", "pelvis", (r * 0.92, r * 1.15, r * 0.82), "body", at=head, trunk=True)
    add("letters_left", SHANK["left"], tint="left", turn=_DOWN, at=band)
    add("letters_right", SHANK["right"], tint="right", turn=_DOWN, at=band)
    for side in SIDES:
        add("soles", FOOT[side], tint=side, at=(0.25 * body.foot, -body.ankle_height, 0.0))
    return parts


def _facing(q: Floats) -> Floats:
    """Turn (m, 4) about the vertical to where x of q (m, 4) points: core.rotation's yaw, in fewer steps."""
    w, x, y, z = q.T
    return rotation.about(2, np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)))


def _turning(turn: Floats) -> Floats:
    """Matrix (4, 4) with q ⊗ turn = q @ matrix."""
    return np.array([rotation.multiply(row, turn) for row in np.eye(4)])


def _swinging(at: Floats) -> Floats:
    """Matrix (16, 3) with R(q) at = at + (all products of two components of q) @ matrix, for unit q.

    R(q) v = v + 2 w (u × v) + 2 u × (u × v) is quadratic in the components (core.rotation.rotate).
    """
    found = np.zeros((4, 4, 3))
    for i, u in enumerate(np.eye(3), start=1):
        found[0, i] = 2.0 * np.cross(u, at)
        for k, v in enumerate(np.eye(3), start=1):
            found[i, k] = 2.0 * np.cross(u, np.cross(v, at))
    return found.reshape(16, 3)


@lru_cache(maxsize=2)
def _letter(side: Side) -> shapes.Mesh:
    radius, length = _BAND
    return shapes.make_letter(side, radius + 0.002, length, 0.8 * length, _SEEN_FROM)


@lru_cache(maxsize=32)
def _shoe(body: BodyModel) -> shapes.Mesh:
    return shapes.make_shoe(body.foot, body.ankle_height)
