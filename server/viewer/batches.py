"""Batches of a layout as nodes of a viser scene."""

from __future__ import annotations

from typing import Final

import numpy as np
import viser
from numpy.typing import NDArray
from viser._messages import SceneNodeUpdateMessage

from server.viewer.colours import GHOST, TINTS, to_linear_rgb
from server.viewer.layout import MeshBatch
from server.viewer.steps import Single

PALE: Final = 0.5
"""Opacity of another visit and of a reference."""

FAINT: Final = 0.35
"""Opacity of a part that no sensor supports."""


def add_batch(
    scene: viser.SceneApi, name: str, batch: MeshBatch, *, ghost: bool = False
) -> viser.BatchedMeshHandle:
    """Draw the first frame of a batch; with `ghost` the legs of the second too, pale, in the same node."""
    frames = 2 if ghost else 1
    opacity, scale = np.where(batch.measured, 1.0, FAINT).astype(np.float32), batch.scale
    if ghost:
        opacity = np.append(opacity, np.full(len(opacity), PALE, np.float32))
        # trunk and head of both are in the same place
        legs = np.array([[tint != "body"] for tint in batch.tint], np.float32)
        legs *= np.array(batch.ghostly, np.float32)[:, None]
        scale = np.concatenate((scale, legs * scale))
    return scene.add_batched_meshes_simple(
        name,
        *batch.mesh,
        batch.wxyz[:frames].reshape(-1, 4),
        batch.position[:frames].reshape(-1, 3),
        batched_scales=scale,
        batched_colors=colour_copies(batch, dark=False, ghost=ghost),
        batched_opacities=None if (opacity == 1.0).all() else opacity,
        lod="off",
        receive_shadow=False,
    )


def colour_copies(
    batch: MeshBatch, dark: bool, *, ghost: bool = False, grey: bool = False
) -> NDArray[np.uint8]:
    """Return the colours of all copies, (k, 3) and with a ghost (2k, 3), as viser takes them.

    `grey` draws the sides in the colour of the body.
    """
    tints = ["body" if grey and tint in ("left", "right") else tint for tint in batch.tint]
    own = [to_linear_rgb(TINTS[dark][tint]) for tint in tints]
    return np.array(own + [to_linear_rgb(GHOST[dark])] * (len(own) * ghost), np.uint8)


def move_copies(handle: viser.BatchedMeshHandle, wxyz: Single, position: Single) -> None:
    """Turn (k, 4) and place (k, 3) all copies by one message; the public setters take one each.

    A message is what a frame costs, not its bytes; the test of viser's contract holds what this relies on.
    """
    inside = handle._impl  # noqa: SLF001
    moved = {"batched_wxyzs": wxyz.copy(), "batched_positions": position.copy()}
    for name, value in moved.items():
        setattr(inside.props, name, value)
    inside.api._queue_scene_message(SceneNodeUpdateMessage(inside.name, dict(moved)))  # noqa: SLF001
