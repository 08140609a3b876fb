"""A precomputed motion as a viser scene: batched meshes in a movable room."""

from __future__ import annotations

import numpy as np
import viser

from sagittal.core.frames import Floats
from sagittal.server.viewer.batches import DrawnBatch, colour_copies, draw_figure, draw_ghost
from sagittal.server.viewer.body_parts import PartName
from sagittal.server.viewer.ghost import find_heading
from sagittal.server.viewer.motion import GhostMotion, GhostName, ReplayMotion
from sagittal.server.viewer.replay.replay_floor import ReplayFloor
from sagittal.server.viewer.room import (
    FLOOR_M,
    FOV_RAD,
    ROOM,
    CameraShot,
    SceneRoom,
    ViewName,
    frame_person,
    turn_about_vertical,
)
from sagittal.server.viewer.viser_adapter import show_at_once


class ReplayFigure:
    """Avatar of a recorded walk in one viser server, posed at any time, with an optional overlay.

    Parameters
    ----------
    server : a dedicated viser server.
    motion : prepared by `sagittal.server.viewer.motion.prepare_motion`. t_s : time shown first.
    """

    def __init__(
        self, server: viser.ViserServer, motion: ReplayMotion, dark: bool = False, t_s: float = 0.0
    ) -> None:
        self._server, self._motion, self._t_s = server, motion, t_s
        self._middle = (motion.root.min(axis=0) + motion.root.max(axis=0)) / 2
        scene = server.scene
        x, y = self._middle.tolist()
        self._room = SceneRoom(server, FLOOR_M + 6.0 * float(np.ptp(motion.root, axis=0).max()), (x, y))
        self._drawn = draw_figure(scene, motion.batches, middle=(x, y))
        self._headings: Floats | None = None
        self._matched: GhostMotion | None = None
        self._ghost: dict[PartName, DrawnBatch] = {}
        self._ground = ReplayFloor(scene, ROOM, motion)
        self.set_dark(dark)
        self.set_follow(True)

    @property
    def motion(self) -> ReplayMotion:
        """The displayed motion."""
        return self._motion

    def is_valid(self, t_s: float) -> bool:
        """Whether all sensors were available at the frame nearest to `t_s`."""
        return bool(self._motion.valid[self._motion.index(t_s)])

    def pose(self, t_s: float) -> float:
        """Show the frame nearest to `t_s`, send it immediately, and return its time in s."""
        m = self._motion
        i = m.index(t_s)
        self._t_s = float(m.t_s[i])
        valid = bool(m.valid[i])
        ghost = valid and self._matched is not None and self._matched.frames[i] >= 0
        with show_at_once(self._server):
            for drawn, visible in ((self._drawn, valid), (self._ghost, ghost)):
                for part in drawn.values():
                    part.handle.visible = bool(visible)
                    if visible:
                        part.move(part.batch.wxyz[i], part.batch.position[i])
            self._room.bring(*(m.root[i] if self._follow else self._middle).tolist())
            self._ground.show(self._t_s, recent=self._follow)
        return self._t_s

    def set_dark(self, dark: bool) -> None:
        """Change all colours to the theme of the embedding page."""
        self._dark = dark
        for part in self._drawn.values():
            part.handle.batched_colors = colour_copies(part.batch, dark)
        for part in self._ghost.values():
            part.handle.batched_colors = colour_copies(part.batch, dark, ghost=True)
        self._ground.set_dark(dark)
        self._room.set_dark(dark)
        self._server.flush()

    def set_follow(self, follow: bool) -> None:
        """Keep the avatar centred, or show the whole walk from a distance."""
        self._follow = follow
        m = self._motion
        self._room.look(frame_person(m.size, m.facing) if follow else _whole(m))
        self.pose(self._t_s)

    def look_from(self, view: ViewName) -> None:
        """View the avatar from a side relative to the current walking direction."""
        m = self._motion
        if self._headings is None:
            self._headings = find_heading(m)
        self._room.look(frame_person(m.size, float(self._headings[m.index(self._t_s)]), view))
        if not self._follow:
            self._follow = True
            self.pose(self._t_s)
        self._server.flush()

    def set_ghost(self, name: GhostName | None) -> bool:
        """Overlay another walk, None = none; return whether it is available."""
        overlay = self._motion.ghosts.get(name, lambda: None)() if name is not None else None
        for part in self._ghost.values():
            part.handle.remove()
        self._matched, self._ghost = overlay, {}
        if overlay is not None:
            # each has a separate name: under a reused name the client may keep an older shader
            x, y = self._middle.tolist()
            self._ghost = draw_ghost(self._server.scene, overlay.batches, f"_{name}", (x, y))
            for part in self._ghost.values():
                part.handle.batched_colors = colour_copies(part.batch, self._dark, ghost=True)
        self.pose(self._t_s)
        return overlay is not None

    def set_ground(self, visible: bool) -> None:
        """Show or hide footprints and trails."""
        self._ground.set_visible(visible)
        self._server.flush()


def _whole(motion: ReplayMotion) -> CameraShot:
    """Camera above and to the right of the start, with the whole walk in view."""
    sight = turn_about_vertical(motion.facing) @ np.array([0.62, 0.62, -0.48])
    right = np.cross(sight, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    half = np.append(np.ptp(motion.root, axis=0) / 2, motion.size) + 0.2
    corners = half * np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 3)
    horizontal, up, ahead = (corners @ np.stack((right, np.cross(right, sight), sight)).T).T
    # distance at which a corner is inside a square picture with this field of view
    back = np.maximum(abs(horizontal), abs(up)) / np.tan(FOV_RAD / 2) - ahead
    target = np.array([0.0, 0.0, motion.size])
    x, y, z = target - back.max() * sight
    return CameraShot(
        (0.0, 0.0, target[2]), (float(x), float(y), float(z)), fade=2.5 * float(back.max()), section=5.0
    )
