"""Layout of an avatar: mesh instances and their poses.

The same few rigid parts are used at all times, for a whole trial or a single moment. A part is defined in the
axes of its segment, so placing it means assigning the pose of that segment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from sagittal.core import rotation
from sagittal.core.body.model import BodyModel
from sagittal.core.estimators import BY_METHOD
from sagittal.core.frames import FOOT, R_NEUTRAL, SIDES, Floats, Segment, Side
from sagittal.server.viewer.body_parts import PartName, find_toe_bend, locate_ball, make_parts
from sagittal.server.viewer.colours import Tint
from sagittal.server.viewer.few_poses import find_matrices
from sagittal.server.viewer.shapes import Mesh
from sagittal.server.viewer.steps import Single

_WORN: Mapping[str, tuple[Segment, ...]] = {
    method: e.sensors for method, e in BY_METHOD.items() if e.sensors is not None
}
"""Method → instrumented segments, if it also estimates poses of others."""

Carrier = Segment | Literal["trunk", "toes_l", "toes_r"]
"""Carrier of a part: a segment, the trunk above the pelvis, or toes bent by the floor."""

_TOES: Final[Mapping[Side, Carrier]] = {"left": "toes_l", "right": "toes_r"}

_HANGS: Final[Mapping[Carrier, Segment]] = {"trunk": "pelvis", "toes_l": "foot_l", "toes_r": "foot_r"}

_PARTS: Final[Mapping[PartName, tuple[tuple[Carrier, Tint], ...]]] = {
    "thighs": (("thigh_l", "left"), ("thigh_r", "right")),
    "shanks": (("shank_l", "left"), ("shank_r", "right")),
    "foot_l": (("foot_l", "left"),),
    "foot_r": (("foot_r", "right"),),
    "toes_l": (("toes_l", "left"),),
    "toes_r": (("toes_r", "right"),),
    "pelvis": (("pelvis", "body"),),
    "trunk": (("trunk", "body"),),
    # two rings mark the right leg without colour
    "rings": (("shank_r", "ring"),),
    "arms": (("trunk", "body"),),
}
"""Mesh → carriers and colours of its instances."""

_NOT_GHOSTLY: Final = frozenset[PartName]({"trunk", "rings", "arms"})

_NEUTRAL: Final = rotation.from_matrix(R_NEUTRAL)
_NEUTRAL_TURNED: Final = rotation.multiply(rotation.about(2, np.pi), _NEUTRAL)
_SOLE: Final = 0.25
"""Middle of the sole, in foot lengths anterior to the ankle."""


@dataclass(frozen=True, eq=False)
class MeshBatch:
    """Instances of one mesh, k of them in each of m frames.

    Parameters
    ----------
    wxyz : (m, k, 4). position : (m, k, 3) m, world. tint : k colour roles.
    measured : k, False if the part carries no sensor and its pose is estimated.
    ghostly : whether a ghost includes this part.
    """

    mesh: Mesh
    wxyz: Single
    position: Single
    tint: tuple[Tint, ...]
    measured: tuple[bool, ...]
    ghostly: bool


@dataclass(frozen=True, eq=False)
class PlacedFigure:
    """An avatar in m frames.

    Parameters
    ----------
    wxyz : (m, c, 4), position : (m, c, 3) m, world, of the instances of all meshes, as listed in
        `FigureLayout.copies`. soles : side → (m, 3) m, world.
    """

    wxyz: Single
    position: Single
    soles: Mapping[Side, Single]


class FigureLayout:
    """The parts of an avatar.

    Parameters
    ----------
    segments : segments with a pose, in the order expected by `place`; other parts are omitted.
    method : estimation method, which determines the instrumented segments.
    """

    def __init__(self, segments: Sequence[Segment], body: BodyModel, method: str) -> None:
        self.segments = tuple(segments)
        self._body = body
        self._feet = tuple(side for side in SIDES if FOOT[side] in segments)
        self._points = np.array([locate_ball(body), (_SOLE * body.foot, -body.ankle_height, 0.0)])
        meshes, instrumented = make_parts(body), _WORN.get(method, self.segments)
        self._parts = {
            name: (
                meshes[name],
                copies,
                tuple(_HANGS.get(carrier, carrier) in instrumented for carrier, _ in copies),
            )
            for name, all_copies in _PARTS.items()
            if (copies := tuple(x for x in all_copies if _HANGS.get(x[0], x[0]) in segments))
        }
        # carriers in the order of `place`: segments, trunk, toes
        trunk: tuple[Carrier, ...] = ("trunk",) if "pelvis" in segments else ()
        carriers = (*self.segments, *trunk, *(_TOES[side] for side in self._feet))
        self._of_feet = [self.segments.index(FOOT[side]) for side in self._feet]
        self._of_copies = [carriers.index(c) for _, copies, _ in self._parts.values() for c, _ in copies]
        ends = np.cumsum([len(copies) for _, copies, _ in self._parts.values()]).tolist()
        self.copies: Mapping[PartName, slice] = {
            name: slice(a, b) for name, a, b in zip(self._parts, [0, *ends], ends, strict=False)
        }
        """Mesh → indices of its instances among those of all meshes."""

    def place(self, q: Floats, p: Floats) -> PlacedFigure:
        """Place all parts; q (m, s, 4) and p (m, s, 3) of the segments of this layout."""
        turns, places = [q], [p]
        if "pelvis" in self.segments:
            pelvis = _column(self.segments.index("pelvis"))
            # parts of the chest follow its orientation; otherwise only the heading is known
            chest = _column(self.segments.index("chest")) if "chest" in self.segments else None
            turns.append(_stand_up(q[:, pelvis]) if chest is None else q[:, chest])
            places.append(p[:, pelvis])
        soles: dict[Side, Single] = {}
        if self._feet:
            # (m, feet, 4) and two points per foot: both feet at once
            foot = q[:, self._of_feet]
            matrices = find_matrices(foot)
            points = p[:, self._of_feet, None] + self._points @ matrices.swapaxes(-1, -2)
            pitch = np.arcsin(np.minimum(np.maximum(matrices[..., 2, 0], -1.0), 1.0))
            bend = find_toe_bend(self._body, pitch, points[..., 0, 2])[..., None]
            turns.append(np.cos(0.5 * bend) * foot + np.sin(0.5 * bend) * (foot[..., ::-1] * _ABOUT_Z))
            places.append(points[:, :, 0])
            middles = points[:, :, 1].astype(np.float32)
            soles = {side: middles[:, k] for k, side in enumerate(self._feet)}
        return PlacedFigure(
            # `take` makes the instances of a mesh contiguous in memory
            np.concatenate(turns, axis=1, dtype=np.float32).take(self._of_copies, axis=1),
            np.concatenate(places, axis=1, dtype=np.float32).take(self._of_copies, axis=1),
            soles,
        )

    def divide(self, placed: PlacedFigure) -> dict[PartName, MeshBatch]:
        """Return mesh → its instances, for drawing."""
        return {
            name: MeshBatch(
                mesh,
                placed.wxyz[:, self.copies[name]],
                placed.position[:, self.copies[name]],
                tuple(tint for _, tint in copies),
                measured,
                name not in _NOT_GHOSTLY,
            )
            for name, (mesh, copies, measured) in self._parts.items()
        }


_ABOUT_Z: Final = np.array([-1.0, 1.0, -1.0, 1.0])
"""Of the reversed components of q: q ⊗ (0, 0, 0, 1)."""


def _column(k: int) -> slice:
    return slice(k, k + 1)


def _stand_up(q: Floats) -> Floats:
    """Upright axes (..., 4) with the heading of x of q (..., 4), like `core.rotation.yaw` in fewer steps."""
    matrices = find_matrices(q)
    half = 0.5 * np.arctan2(matrices[..., 1, 0], matrices[..., 0, 0])[..., None]
    return np.cos(half) * _NEUTRAL + np.sin(half) * _NEUTRAL_TURNED
