"""Which copies of which mesh a figure is made of, and where each of them is.

The same few rigid parts whatever the time: laid out for a whole take or for one moment alike. A part lies in
the axes of what carries it, so that to place it is to give it the pose of its carrier.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from core import rotation
from core.body.model import BodyModel
from core.estimators import BY_METHOD
from core.frames import FOOT, R_NEUTRAL, SEGMENTS, SIDES, Floats, Segment, Side
from server.viewer.body_parts import PartName, find_toe_bend, locate_ball, make_parts
from server.viewer.colours import Tint
from server.viewer.shapes import Mesh
from server.viewer.steps import Single

_WORN: Mapping[str, tuple[Segment, ...]] = {
    method: e.sensors for method, e in BY_METHOD.items() if e.sensors is not None
}
"""Method → segments whose sensors it uses, where it gives poses of others too."""

Carrier = Segment | Literal["trunk", "toes_l", "toes_r"]
"""What a part hangs on: a segment, the trunk over the pelvis, or toes that the floor bends."""

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
    # two rings tell the right leg where colours do not
    "rings": (("shank_r", "ring"),),
    "arms": (("trunk", "body"),),
}
"""Mesh → carriers and colours of its copies."""

_NOT_GHOSTLY: Final = frozenset[PartName]({"trunk", "rings", "arms"})

_NEUTRAL: Final = rotation.from_matrix(R_NEUTRAL)
_SOLE: Final = 0.25
"""Middle of the sole, of the foot's length in front of the ankle."""


@dataclass(frozen=True, eq=False)
class MeshBatch:
    """Copies of one mesh, k of them in each of m frames.

    Parameters
    ----------
    wxyz : (m, k, 4). position : (m, k, 3) m, world. tint : k colour roles.
    measured : k, False where no sensor supports the part and the estimator alone says where it is.
    ghostly : whether another walk laid over it shows this part too.
    """

    mesh: Mesh
    wxyz: Single
    position: Single
    tint: tuple[Tint, ...]
    measured: tuple[bool, ...]
    ghostly: bool


@dataclass(frozen=True, eq=False)
class PlacedFigure:
    """A figure in m frames.

    Parameters
    ----------
    batches : name → copies of one mesh. soles : side → (m, 3) m, world.
    """

    batches: Mapping[PartName, MeshBatch]
    soles: Mapping[Side, Single]


class FigureLayout:
    """The parts of a figure.

    Parameters
    ----------
    segments : those with a pose; parts of others are left out. method : the estimator's, says which of them
        carry a sensor.
    """

    def __init__(self, segments: Sequence[Segment], body: BodyModel, method: str) -> None:
        self.segments = tuple(s for s in SEGMENTS if s in segments)
        self._body = body
        self._feet = tuple(side for side in SIDES if FOOT[side] in self.segments)
        self._points = np.array([locate_ball(body), (_SOLE * body.foot, -body.ankle_height, 0.0)])
        meshes, worn = make_parts(body), _WORN.get(method, self.segments)
        self._parts = {
            name: (
                meshes[name],
                copies,
                tuple(_HANGS.get(carrier, carrier) in worn for carrier, _ in copies),
            )
            for name, all_copies in _PARTS.items()
            if (copies := tuple(x for x in all_copies if _HANGS.get(x[0], x[0]) in self.segments))
        }

    def place(self, q: Mapping[Segment, Floats], p: Mapping[Segment, Floats]) -> PlacedFigure:
        """Place all parts; q (m, 4) and p (m, 3) of every segment of this layout."""
        turn: dict[Carrier, Floats] = {s: q[s] for s in self.segments}
        at: dict[Carrier, Floats] = {s: p[s] for s in self.segments}
        if "pelvis" in turn:
            # a chest carries its parts as it is turned, a heading only knows where the front is
            turn["trunk"] = q["chest"] if "chest" in q else _stand_up(q["pelvis"])
            at["trunk"] = p["pelvis"]
        soles: dict[Side, Single] = {}
        if self._feet:
            # (m, feet, 4) and of each foot two points: both feet at once
            foot = np.stack([q[FOOT[side]] for side in self._feet], axis=1)
            ankle = np.stack([p[FOOT[side]] for side in self._feet], axis=1)
            points = ankle[:, :, None] + rotation.rotate(foot[:, :, None], self._points)
            w, x, y, z = np.moveaxis(foot, -1, 0)
            pitch = np.arcsin(np.clip(2.0 * (x * z - w * y), -1.0, 1.0))
            bend = find_toe_bend(self._body, pitch, points[:, :, 0, 2])
            toes = rotation.multiply(foot, rotation.about(2, bend))
            for k, side in enumerate(self._feet):
                turn[_TOES[side]], at[_TOES[side]] = toes[:, k], points[:, k, 0]
                soles[side] = points[:, k, 1].astype(np.float32)
        return PlacedFigure(
            {
                name: MeshBatch(
                    mesh,
                    np.stack([turn[c] for c, _ in copies], axis=1, dtype=np.float32),
                    np.stack([at[c] for c, _ in copies], axis=1, dtype=np.float32),
                    tuple(tint for _, tint in copies),
                    measured,
                    name not in _NOT_GHOSTLY,
                )
                for name, (mesh, copies, measured) in self._parts.items()
            },
            soles,
        )


def _stand_up(q: Floats) -> Floats:
    """Upright axes (m, 4) that face where x of q (m, 4) points: core.rotation's yaw, in fewer steps."""
    w, x, y, z = q.T
    heading = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    return rotation.multiply(rotation.about(2, heading), _NEUTRAL)
