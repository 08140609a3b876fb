"""A prepared motion as a viser scene: batched meshes in a room that may move past."""

from __future__ import annotations

import numpy as np
import viser

from server.viewer.batches import PALE, add_batch, colour_copies, move_copies
from server.viewer.colours import GHOST, to_linear_rgb
from server.viewer.layout import MeshBatch
from server.viewer.motion import GhostMotion, ReplayMotion
from server.viewer.replay_floor import ReplayFloor
from server.viewer.room import (
    FLOOR_M,
    FOV_RAD,
    ROOM,
    CameraShot,
    SceneRoom,
    frame_person,
    turn_about_vertical,
)


class ReplayFigure:
    """A recorded walk in one viser server, posed at any time, with another visit laid over it.

    Parameters
    ----------
    server : a viser server of its own.
    motion : prepared by `server.viewer.motion.prepare_motion`.
    """

    def __init__(self, server: viser.ViserServer, motion: ReplayMotion, dark: bool = False) -> None:
        self._server, self._motion = server, motion
        self._t_s = float(motion.t_s[0])
        self._middle = (motion.root.min(axis=0) + motion.root.max(axis=0)) / 2
        scene = server.scene
        x, y = self._middle.tolist()
        self._room = SceneRoom(server, FLOOR_M + 6.0 * float(np.ptp(motion.root, axis=0).max()), (x, y))
        self._batches = [
            (b, add_batch(scene, f"{ROOM}/{name}", b)) for name, b in motion.batches.items() if b.tint
        ]
        self._ghost_batches: list[tuple[MeshBatch, viser.BatchedMeshHandle]] = []
        if motion.ghost is not None:
            self._ghost_node = scene.add_frame(f"{ROOM}/ghost", show_axes=False)
            self._ghost_batches = _add_ghost(scene, motion.ghost)
        self._ghost_shown = True
        self._ground = ReplayFloor(scene, ROOM, motion)
        self.set_dark(dark)
        self.set_follow(True)

    @property
    def motion(self) -> ReplayMotion:
        """The motion that is shown."""
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
        with self._server.atomic():
            for batch, handle in self._batches:
                handle.visible = valid
                if valid:
                    move_copies(handle, batch.wxyz[i], batch.position[i])
            self._pose_ghost(i, valid=valid)
            self._room.bring(*(m.root[i] if self._follow else self._middle).tolist())
            self._ground.show(self._t_s, recent=self._follow)
        self._server.flush()
        return self._t_s

    def set_dark(self, dark: bool) -> None:
        """Change all colours to the theme of the page around."""
        for batch, handle in self._batches:
            handle.batched_colors = colour_copies(batch, dark)
        for _, handle in self._ghost_batches:
            handle.batched_colors = np.array(to_linear_rgb(GHOST[dark]), np.uint8)
        self._ground.set_dark(dark)
        self._room.set_dark(dark)
        self._server.flush()

    def set_follow(self, follow: bool) -> None:
        """Keep the person in the middle of the picture, or stand back and let the whole walk pass."""
        self._follow = follow
        m = self._motion
        self._room.look(frame_person(m.size, m.facing) if follow else _whole(m))
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
                move_copies(handle, batch.wxyz[j], batch.position[j])
        if visible:
            half = float(ghost.turn[i]) / 2
            self._ghost_node.wxyz = (float(np.cos(half)), 0.0, 0.0, float(np.sin(half)))
            self._ghost_node.position = (float(ghost.place[i, 0]), float(ghost.place[i, 1]), 0.0)

    def set_ground(self, visible: bool) -> None:
        """Show or hide footprints and trails."""
        self._ground.set_visible(visible)
        self._server.flush()


def _whole(motion: ReplayMotion) -> CameraShot:
    """From above, behind the start and right of the way, all of it in the picture."""
    sight = turn_about_vertical(motion.facing) @ np.array([0.62, 0.62, -0.48])
    right = np.cross(sight, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    half = np.append(np.ptp(motion.root, axis=0) / 2, motion.size) + 0.2
    corners = half * np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 3)
    across, up, ahead = (corners @ np.stack((right, np.cross(right, sight), sight)).T).T
    # how far back the eye must be for a corner to be inside a square picture of this angle
    back = np.maximum(abs(across), abs(up)) / np.tan(FOV_RAD / 2) - ahead
    at = np.array([0.0, 0.0, motion.size])
    x, y, z = at - back.max() * sight
    return CameraShot(
        (0.0, 0.0, at[2]), (float(x), float(y), float(z)), fade=2.5 * float(back.max()), section=5.0
    )


def _add_ghost(scene: viser.SceneApi, ghost: GhostMotion) -> list[tuple[MeshBatch, viser.BatchedMeshHandle]]:
    """The other visit, pale and without a shadow or letters, on a node of its own."""
    return [
        (
            batch,
            scene.add_batched_meshes_simple(
                f"{ROOM}/ghost/{name}",
                *batch.mesh,
                batch.wxyz[0],
                batch.position[0],
                batched_scales=batch.scale * np.array(batch.ghostly, np.float32)[:, None],
                batched_colors=to_linear_rgb(GHOST[False]),
                opacity=PALE,
                lod="off",
                cast_shadow=False,
                receive_shadow=False,
                visible=False,
            ),
        )
        for name, batch in ghost.motion.batches.items()
        if any(batch.ghostly)
    ]
