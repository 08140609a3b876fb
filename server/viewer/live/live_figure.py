"""Avatar updated from live poses: the same batches as the replay, one frame at a time."""

from __future__ import annotations

from functools import lru_cache
from math import atan2
from typing import Final

import numpy as np
import viser

from sagittal.core.body.model import BodyModel
from sagittal.core.frames import FOOT, SIDES, Segment
from sagittal.server.viewer.batches import DrawnFigure, colour_copies, draw_figure, draw_ghost
from sagittal.server.viewer.layout import FigureLayout, PlacedFigure
from sagittal.server.viewer.live.live_floor import LiveFloor
from sagittal.server.viewer.live.live_path import GAP_S, LivePath
from sagittal.server.viewer.live.moment import FigureMoment
from sagittal.server.viewer.reference import SEGMENTS, ReferenceWalk, stand_upright
from sagittal.server.viewer.room import SceneRoom, frame_person
from sagittal.server.viewer.viser_adapter import show_at_once

_BURIED: Final = np.array([0.0, 0.0, -100.0])
"""Position of a ghost without a phase."""


class LiveFigure:
    """One avatar in one viser server, standing and grey until poses arrive.

    Parameters
    ----------
    server : a dedicated viser server.
    """

    def __init__(self, server: viser.ViserServer, body: BodyModel, dark: bool = False) -> None:
        self._server, self._body, self._dark = server, body, dark
        self._room = SceneRoom(server)
        self._floor = LiveFloor(server.scene, body.foot)
        self._path = LivePath()
        self._reference: ReferenceWalk | None = None
        self._layout: FigureLayout | None = None
        self._key: tuple[object, ...] = ()
        self._drawn, self._ghost = DrawnFigure({}, {}), DrawnFigure({}, {})
        self._times = 0
        self._grey = True
        self._t_s: float | None = None
        self._room.set_dark(dark)
        self._floor.set_dark(dark)
        size = (body.thigh + body.shank + body.ankle_height) / 0.9
        self._room.look(frame_person(size, 0.0))
        self.wait()

    @property
    def is_grey(self) -> bool:
        """Whether the avatar is grey because its data are outdated."""
        return self._grey

    def wait(self) -> None:
        """Show the avatar standing until poses arrive."""
        if self._key == ("standing",):
            return
        q, p = (x[np.newaxis] for x in stand_upright(self._body))
        self._floor.clear()
        self._path, self._t_s = LivePath(), None
        layout = FigureLayout(SEGMENTS, self._body, "")
        self._draw(layout, layout.place(q, p), ("standing",))
        self._room.bring(0.0, 0.0)
        self._set_grey(True)
        self._server.flush()

    def show(self, moment: FigureMoment, *, late: bool = False) -> None:
        """Show a frame and send it immediately; an invalid one leaves the avatar unchanged and grey.

        Parameters
        ----------
        late : the frame is outdated; shown in grey.
        """
        if self._t_s is not None and not 0.0 <= moment.t_s - self._t_s <= GAP_S:
            self._floor.clear()
        self._t_s = moment.t_s
        if not moment.valid:
            self._floor.lose()
            self._set_grey(True)
            self._server.flush()
            return
        with show_at_once(self._server):
            self._show(moment)
            self._set_grey(late)

    def set_stale(self) -> None:
        """Turn the avatar grey until the next frame, after a gap in the data."""
        if not self._grey:
            self._set_grey(True)
            self._server.flush()

    def set_reference(self, walk: ReferenceWalk | None) -> None:
        """Overlay a walk as a ghost at the same phase of the gait cycle, None = none."""
        self._reference = walk

    def _show(self, moment: FigureMoment) -> None:
        segments = moment.segments
        lead = segments.index("pelvis") if "pelvis" in segments else 0
        x, y, _ = moment.p[lead].tolist()
        root_x, root_y, heading = self._path.push(moment.t_s, x, y, _yaw(*moment.q[lead].tolist()))
        q, p = moment.q[np.newaxis], moment.p[np.newaxis]
        rows = None if self._reference is None else _find_rows(segments)
        if rows is not None and self._reference is not None:
            # the ghost is an additional frame of the same layout
            q, p = np.concatenate((q, q)), np.concatenate((p, p))
            ghost_pose = self._reference.at(moment.phase, (x, y), heading)
            # a trunk without a pose of its own follows the ghost's pelvis
            p[1] = _BURIED if ghost_pose is None else ghost_pose[1][0]
            if ghost_pose is not None:
                q[1, rows], p[1, rows] = ghost_pose
        ghost = rows is not None
        key = (segments, moment.method, ghost)
        layout = self._layout
        if layout is None or key != self._key:
            layout = FigureLayout(segments, self._body, moment.method)
            self._draw(layout, layout.place(q, p), key, ghost=ghost)
        placed, drawings = layout.place(q, p), (self._drawn, self._ghost)
        for wxyz, position, drawn in zip(placed.wxyz, placed.position, drawings, strict=False):
            drawn.move(wxyz, position)
        for side in SIDES:
            if side in placed.soles:
                sole, foot = placed.soles[side][0], moment.q[segments.index(FOOT[side])]
                self._floor.push(moment.t_s, side, sole, foot, moment.contact.get(side))
        self._floor.send(moment.t_s)
        self._room.bring(root_x, root_y)

    def _draw(
        self,
        layout: FigureLayout,
        placed: PlacedFigure,
        key: tuple[object, ...],
        *,
        ghost: bool = False,
    ) -> None:
        """Draw a different set of parts."""
        for part in (*self._drawn.parts.values(), *self._ghost.parts.values()):
            part.handle.remove()
        self._layout, self._key = layout, key
        # a new name each time: under the old one the client keeps its shader, which does not support the
        # opacities of the new instances (GL_INVALID_OPERATION, and nothing is drawn)
        self._times += 1
        scene, suffix, batches = self._server.scene, f"_{self._times}", layout.divide(placed)
        self._drawn = DrawnFigure(draw_figure(scene, batches, suffix), layout.copies)
        self._ghost = DrawnFigure(draw_ghost(scene, batches, suffix) if ghost else {}, layout.copies)
        self._paint()

    def _set_grey(self, grey: bool) -> None:
        if grey != self._grey:
            self._grey = grey
            self._paint()

    def _paint(self) -> None:
        for part in self._drawn.parts.values():
            part.handle.batched_colors = colour_copies(part.batch, self._dark, grey=self._grey)
        for part in self._ghost.parts.values():
            part.handle.batched_colors = colour_copies(part.batch, self._dark, ghost=True)


@lru_cache(maxsize=32)
def _find_rows(segments: tuple[Segment, ...]) -> tuple[int, ...] | None:
    """Indices of a ghost's segments among those with a pose; None if one is missing."""
    return tuple(map(segments.index, SEGMENTS)) if set(SEGMENTS) <= set(segments) else None


def _yaw(w: float, x: float, y: float, z: float) -> float:
    """Scalar version of sagittal.core.rotation.yaw."""
    return atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
