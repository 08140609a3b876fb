"""Batches of a layout as nodes of a viser scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import viser
from numpy.typing import NDArray

from sagittal.server.viewer.body_parts import PartName
from sagittal.server.viewer.colours import GHOST, TINTS, to_linear_rgb
from sagittal.server.viewer.layout import MeshBatch
from sagittal.server.viewer.room import ROOM
from sagittal.server.viewer.steps import Single
from sagittal.server.viewer.viser_adapter import move_copies

PALE: Final = 0.5
"""Opacity of a ghost."""

FAINT: Final = 0.35
"""Opacity of a part without a sensor."""

ARMS: Final = 0.2
"""Opacity of the arms, which are never measured; fainter, since they cross a thigh in side view."""

RAISED_M: Final = 1.0
"""Height of the origins of transparent nodes above that of the floor. The browser draws such nodes from far
to near by their origins, and each hides later ones: at the floor's height they would cut holes into its
lines.
"""


class DrawnBatch:
    """Instances of one mesh in a scene.

    Parameters
    ----------
    name : of the node in the room. opacity : of all instances; None = 1, and `FAINT` for those not measured.
    middle : (2,) m, centre of the floor.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        batch: MeshBatch,
        opacity: float | None,
        middle: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.batch = batch
        faint = np.where(batch.measured, 1.0, FAINT).astype(np.float32)
        see_through = opacity is not None or bool((faint < 1.0).any())
        self.origin = np.array((*middle, RAISED_M) if see_through else (0.0, 0.0, 0.0), np.float32)
        self.handle = scene.add_batched_meshes_simple(
            f"{ROOM}/{name}",
            *batch.mesh,
            batch.wxyz[0],
            batch.position[0] - self.origin,
            batched_colors=colour_copies(batch, dark=False),
            batched_opacities=faint if opacity is None and see_through else None,
            opacity=opacity,
            lod="off",
            cast_shadow=opacity is None,
            receive_shadow=False,
            position=tuple(self.origin.tolist()),
        )

    def move(self, wxyz: Single, position: Single) -> None:
        """Set orientations (k, 4) and positions (k, 3) m of all instances; do not modify `wxyz`
        afterwards.
        """
        move_copies(self.handle, wxyz, position - self.origin)


class DrawnFigure:
    """The batches of an avatar or a ghost, which are moved together.

    Parameters
    ----------
    copies : mesh → indices of its instances among those of all meshes (`FigureLayout.copies`).
    """

    def __init__(self, parts: Mapping[PartName, DrawnBatch], copies: Mapping[PartName, slice]) -> None:
        self.parts = parts
        self._rows = [(part.handle, copies[name]) for name, part in parts.items()]
        self._origins = np.zeros((max((rows.stop for rows in copies.values()), default=0), 3), np.float32)
        for name, part in parts.items():
            self._origins[copies[name]] = part.origin

    def move(self, wxyz: Single, position: Single) -> None:
        """Set orientations (c, 4) and positions (c, 3) m of all instances; do not modify `wxyz`
        afterwards.
        """
        inside = position - self._origins
        for handle, rows in self._rows:
            move_copies(handle, wxyz[rows], inside[rows])


def draw_figure(
    scene: viser.SceneApi,
    batches: Mapping[PartName, MeshBatch],
    suffix: str = "",
    middle: tuple[float, float] = (0.0, 0.0),
) -> dict[PartName, DrawnBatch]:
    """Draw the first frame of an avatar; arms are always faint."""
    return {
        name: DrawnBatch(scene, f"{name}{suffix}", batch, ARMS if name == "arms" else None, middle)
        for name, batch in batches.items()
    }


def draw_ghost(
    scene: viser.SceneApi,
    batches: Mapping[PartName, MeshBatch],
    suffix: str = "",
    middle: tuple[float, float] = (0.0, 0.0),
) -> dict[PartName, DrawnBatch]:
    """Draw another walk as a ghost: legs and pelvis only, pale and without a shadow, on separate nodes.

    The trunks and arms of both would coincide; legs are distinguished by their position.
    """
    return {
        name: DrawnBatch(scene, f"ghost_{name}{suffix}", batch, PALE, middle)
        for name, batch in batches.items()
        if batch.ghostly
    }


def colour_copies(
    batch: MeshBatch, dark: bool, *, grey: bool = False, ghost: bool = False
) -> NDArray[np.uint8]:
    """Return the colours of all instances, (k, 3), for viser; `grey` draws the sides like the body."""
    if ghost:
        return np.array([to_linear_rgb(GHOST[dark])] * len(batch.tint), np.uint8)
    tints = ["body" if grey and tint in ("left", "right") else tint for tint in batch.tint]
    return np.array([to_linear_rgb(TINTS[dark][tint]) for tint in tints], np.uint8)
