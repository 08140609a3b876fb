"""A prepared motion as a viser scene: three batched meshes and two letters in a room that may move past.

Everything that has a place in the room hangs on one node. To follow the person is to move that node, not the
camera, so that the hand on the camera and the view that follows never fight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray

from core.frames import Floats
from server.viewer.colours import BACKGROUND, FLOOR, GHOST, TINTS, linear
from server.viewer.ghost import Ghost
from server.viewer.ground import Ground
from server.viewer.layout import Batch
from server.viewer.motion import Motion

_FOV_RAD = np.deg2rad(31.0)
_FLOOR_M = 60.0
_PALE = 0.5
"""Opacity of another visit."""

_FAINT = 0.35
"""Opacity of a part that no sensor supports."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Shot:
    """A place to look from, in m: at, eye in the scene; fade, section are end and lines of the floor."""

    at: Vector
    eye: Vector
    fade: float
    section: float


class Figure:
    """One person in one viser server.

    Parameters
    ----------
    server : a viser server of its own.
    motion : prepared by `server.viewer.motion.prepare`.
    """

    def __init__(self, server: viser.ViserServer, motion: Motion, dark: bool = False) -> None:
        self._server, self._motion = server, motion
        self._t_s = float(motion.t_s[0])
        self._middle = (motion.root.min(axis=0) + motion.root.max(axis=0)) / 2
        scene = server.scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.configure_default_lights(True, cast_shadow=True)
        self._room = scene.add_frame("/room", show_axes=False)
        size = _FLOOR_M + 6.0 * float(np.ptp(motion.root, axis=0).max())
        x, y = (float(v) for v in self._middle)
        self._grid = scene.add_grid("/room/floor", size, size, shadow_opacity=0.2, position=(x, y, 0.0))
        self._batches = [
            (b, _add_batch(scene, f"/room/{name}", b)) for name, b in motion.batches.items() if b.tint
        ]
        self._ghost_batches: list[tuple[Batch, viser.BatchedMeshHandle]] = []
        if motion.ghost is not None:
            self._ghost_node = scene.add_frame("/room/ghost", show_axes=False)
            self._ghost_batches = _add_ghost(scene, motion.ghost)
        self._ghost_shown = True
        self._ground = Ground(scene, "/room", motion)
        self._letters = {
            side: scene.add_label(
                f"/room/letter_{side}", side[0].upper(), font_screen_scale=1.3, anchor="center-left"
            )
            for side in motion.toes
        }
        server.initial_camera.fov = float(_FOV_RAD)
        self.set_dark(dark)
        self.set_follow(True)

    @property
    def motion(self) -> Motion:
        """What is shown."""
        return self._motion

    def is_valid(self, t_s: float) -> bool:
        """Tell whether all sensors were there at the frame nearest to `t_s`."""
        return bool(self._motion.valid[self._motion.index(t_s)])

    def pose(self, t_s: float) -> float:
        """Show the frame nearest to `t_s`, send it at once, and return its time in s."""
        m = self._motion
        i = m.index(t_s)
        self._t_s = float(m.t_s[i])
        valid = bool(m.valid[i])
        x, y = (float(-v) for v in (m.root[i] if self._follow else self._middle))
        with self._server.atomic():
            for batch, handle in self._batches:
                handle.visible = valid
                if valid:
                    handle.batched_positions = batch.position[i]
                    handle.batched_wxyzs = batch.wxyz[i]
            self._pose_ghost(i, valid=valid)
            for side, letter in self._letters.items():
                letter.visible = valid and self._follow
                letter.position = m.toes[side][i]
            self._room.position = (x, y, 0.0)
            self._ground.show(self._t_s, recent=self._follow)
        self._server.flush()
        return self._t_s

    def set_dark(self, dark: bool) -> None:
        """Change all colours to the theme of the page around."""
        for batch, handle in self._batches:
            handle.batched_colors = _colours(batch, dark)
        for _, handle in self._ghost_batches:
            handle.batched_colors = np.array(linear(GHOST[dark]), np.uint8)
        self._ground.set_dark(dark)
        self._server.scene.set_background_image(np.full((2, 2, 3), BACKGROUND[dark], np.uint8), format="png")
        self._grid.cell_color, self._grid.section_color = FLOOR[dark]
        self._server.gui.configure_theme(dark_mode=dark, show_logo=False, show_share_button=False)
        self._server.flush()

    def set_follow(self, follow: bool) -> None:
        """Keep the person in the middle of the picture, or stand back and let the whole walk pass."""
        self._follow = follow
        shot = _near(self._motion) if follow else _whole(self._motion)
        self._grid.fade_distance = shot.fade
        self._grid.section_size, self._grid.cell_size = shot.section, shot.section / 5
        initial = self._server.initial_camera
        initial.position, initial.look_at = shot.eye, shot.at
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = shot.eye, shot.at
        self.pose(self._t_s)

    def set_ghost(self, visible: bool) -> None:
        """Show or hide the other visit, where there is one."""
        self._ghost_shown = visible
        self.pose(self._t_s)

    def _pose_ghost(self, i: int, *, valid: bool) -> None:
        ghost = self._motion.ghost
        if ghost is None:
            return
        j = int(ghost.frames[i])
        visible = valid and self._ghost_shown and j >= 0
        for batch, handle in self._ghost_batches:
            handle.visible = visible
            if visible:
                handle.batched_positions = batch.position[j]
                handle.batched_wxyzs = batch.wxyz[j]
        if visible:
            half = float(ghost.turn[i]) / 2
            self._ghost_node.wxyz = (float(np.cos(half)), 0.0, 0.0, float(np.sin(half)))
            self._ghost_node.position = (float(ghost.place[i, 0]), float(ghost.place[i, 1]), 0.0)

    def set_ground(self, visible: bool) -> None:
        """Show or hide footprints and trails."""
        self._ground.set_visible(visible)
        self._server.flush()


def _near(motion: Motion) -> Shot:
    """From the right and slightly from ahead, the whole person in the picture."""
    x, y, z = motion.size * (_turned(motion.facing) @ np.array([1.9, -3.4, 1.75]))
    return Shot((0.0, 0.0, 0.86 * motion.size), (float(x), float(y), float(z)), fade=12.0, section=1.0)


def _whole(motion: Motion) -> Shot:
    """From above, behind the start and right of the way, all of it in the picture."""
    sight = _turned(motion.facing) @ np.array([0.62, 0.62, -0.48])
    right = np.cross(sight, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    half = np.append(np.ptp(motion.root, axis=0) / 2, motion.size) + 0.2
    corners = half * np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 3)
    across, up, ahead = (corners @ np.stack((right, np.cross(right, sight), sight)).T).T
    # how far back the eye must be for a corner to be inside a square picture of this angle
    back = np.maximum(abs(across), abs(up)) / np.tan(_FOV_RAD / 2) - ahead
    at = np.array([0.0, 0.0, motion.size])
    x, y, z = at - back.max() * sight
    return Shot((0.0, 0.0, at[2]), (float(x), float(y), float(z)), fade=2.5 * float(back.max()), section=5.0)


def _turned(heading: float) -> Floats:
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _colours(batch: Batch, dark: bool) -> NDArray[np.uint8]:
    return np.array([linear(TINTS[dark][tint]) for tint in batch.tint], np.uint8)


def _add_ghost(scene: viser.SceneApi, ghost: Ghost) -> list[tuple[Batch, viser.BatchedMeshHandle]]:
    """The other visit, pale and without a shadow, on a node of its own."""
    return [
        (
            batch,
            scene.add_batched_meshes_simple(
                f"/room/ghost/{name}",
                *batch.mesh,
                batch.wxyz[0],
                batch.position[0],
                batched_scales=batch.scale,
                batched_colors=linear(GHOST[False]),
                opacity=_PALE,
                lod="off",
                cast_shadow=False,
                receive_shadow=False,
                visible=False,
            ),
        )
        for name, batch in ghost.motion.batches.items()
        if batch.tint
    ]


def _add_batch(scene: viser.SceneApi, name: str, batch: Batch) -> viser.BatchedMeshHandle:
    measured = np.array(batch.measured)
    return scene.add_batched_meshes_simple(
        name,
        *batch.mesh,
        batch.wxyz[0],
        batch.position[0],
        batched_scales=batch.scale,
        batched_colors=_colours(batch, dark=False),
        batched_opacities=None if measured.all() else np.where(measured, 1.0, _FAINT).astype(np.float32),
        lod="off",
        receive_shadow=False,
    )
