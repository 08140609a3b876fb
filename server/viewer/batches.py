"""Batches of a layout as nodes of a viser scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import viser
from numpy.typing import NDArray
from viser._messages import EntityLifecycle, SceneNodeUpdateMessage

from server.viewer.body_parts import PartName
from server.viewer.colours import GHOST, TINTS, to_linear_rgb
from server.viewer.layout import MeshBatch
from server.viewer.room import ROOM
from server.viewer.steps import Single

PALE: Final = 0.5
"""Opacity of another walk laid over the figure."""

FAINT: Final = 0.35
"""Opacity of a part that no sensor supports."""

ARMS: Final = 0.2
"""Opacity of the arms, which nothing measures; fainter, since seen from the side they cross a thigh."""

RAISED_M: Final = 1.0
"""Height of the origins of see-through nodes over that of the floor. The browser draws such nodes from far
to near by their origins, and each hides what is drawn later behind it: at the floor's height they would cut
holes into its lines."""


_MOVED: Final = ("batched_wxyzs", "batched_positions")


class CopiesMoved(  # type: ignore[call-arg]  # viser's types are not looked at
    SceneNodeUpdateMessage,  # type: ignore[misc]
    entity=EntityLifecycle("scene", "update_dict", "name"),
    include_in_scene_serialization=True,
):
    """viser's message of new properties, of which it is known that they are two arrays of float32.

    viser asks of every field of every message what it is: a third of the time a frame takes.
    """

    def redundancy_key(self) -> str:
        """The newest of a node replaces the one before."""
        return f"scene:{self.name}:moved"

    def as_serializable_dict(self, binary_buffers: list[memoryview] | None = None) -> dict[str, Any]:
        """Say the same as viser's own message."""
        buffers = [] if binary_buffers is None else binary_buffers
        first = len(buffers)
        buffers += [self.updates[name].data for name in _MOVED]
        arrays: list[Any] = buffers[first:]
        if binary_buffers is not None:
            arrays = [{"__binary_index": first + k, "dtype": "<f4"} for k in range(len(_MOVED))]
        return {
            "name": self.name,
            "updates": dict(zip(_MOVED, arrays, strict=True)),
            "owner": self.owner,
            "type": "SceneNodeUpdateMessage",
        }


class DrawnBatch:
    """Copies of one mesh in the room of a scene.

    Parameters
    ----------
    name : of the node in the room. opacity : of all copies; None = 1, and `FAINT` for those not measured.
    middle : (2,) m, of the floor.
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
        self._origin = np.array((*middle, RAISED_M) if see_through else (0.0, 0.0, 0.0), np.float32)
        self.handle = scene.add_batched_meshes_simple(
            f"{ROOM}/{name}",
            *batch.mesh,
            batch.wxyz[0],
            batch.position[0] - self._origin,
            batched_colors=colour_copies(batch, dark=False),
            batched_opacities=faint if opacity is None and see_through else None,
            opacity=opacity,
            lod="off",
            cast_shadow=opacity is None,
            receive_shadow=False,
            position=tuple(self._origin.tolist()),
        )

    def move(self, wxyz: Single, position: Single) -> None:
        """Turn (k, 4) and place (k, 3) m all copies in the room."""
        move_copies(self.handle, wxyz, position - self._origin)


def draw_figure(
    scene: viser.SceneApi,
    batches: Mapping[PartName, MeshBatch],
    suffix: str = "",
    middle: tuple[float, float] = (0.0, 0.0),
) -> dict[PartName, DrawnBatch]:
    """Draw the first frame of a figure; arms are always faint."""
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
    """Draw another walk: its legs and pelvis, pale and without a shadow, on nodes of their own.

    Trunk and arms of both would be in the same place, and which leg is which says where it is.
    """
    return {
        name: DrawnBatch(scene, f"ghost_{name}{suffix}", batch, PALE, middle)
        for name, batch in batches.items()
        if batch.ghostly
    }


def colour_copies(
    batch: MeshBatch, dark: bool, *, grey: bool = False, ghost: bool = False
) -> NDArray[np.uint8]:
    """Return the colours of all copies, (k, 3), as viser takes them; `grey` draws the sides as the body."""
    if ghost:
        return np.array([to_linear_rgb(GHOST[dark])] * len(batch.tint), np.uint8)
    tints = ["body" if grey and tint in ("left", "right") else tint for tint in batch.tint]
    return np.array([to_linear_rgb(TINTS[dark][tint]) for tint in tints], np.uint8)


def move_copies(handle: viser.BatchedMeshHandle, wxyz: Single, position: Single) -> None:
    """Turn (k, 4) and place (k, 3) all copies by one message; the public setters take one each.

    A message is what a frame costs, not its bytes; the test of viser's contract holds what this relies on.
    """
    inside = handle._impl  # noqa: SLF001
    moved = dict(zip(_MOVED, (wxyz.copy(), position.copy()), strict=True))
    inside.props.batched_wxyzs, inside.props.batched_positions = moved.values()
    inside.api._queue_scene_message(CopiesMoved(inside.name, moved))  # noqa: SLF001
