"""Floor marks of a live walk: recent footprints and trails.

Uses the rules of server/viewer/steps.py, applied frame by frame.
"""

from __future__ import annotations

from collections import deque
from math import dist
from typing import Final

import numpy as np
import viser

from sagittal.core import rotation
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.server.viewer import shapes
from sagittal.server.viewer.colours import TINTS, to_linear_rgb
from sagittal.server.viewer.room import ROOM, Vector
from sagittal.server.viewer.steps import CLEAR_M, PIECE_M, REST_MPS, SAME_M, Single
from sagittal.server.viewer.viser_adapter import draw_lines, move_copies

TRAIL_S: Final = 6.0
"""Displayed duration of trails, s."""
PIECES: Final = 192
"""Maximum segments of a trail: 6 s at 1.6 m/s; at higher speeds the oldest disappear sooner."""
PRINTS: Final = 8
"""Footprints per side: about the same duration."""
EVERY_S: Final = 0.1
"""Minimum interval of sending trails."""
REST_S: Final = 0.1
"""Window for the speed of the foot."""

_GONE: Final = np.array([0.0, 0.0, -100.0], np.float32)
_PIXELS, _OPACITY = 1.6, 0.6


class LiveFloor:
    """Footprints and trails in one scene.

    Parameters
    ----------
    foot : length of the foot, m.
    """

    def __init__(self, scene: viser.SceneApi, foot: float) -> None:
        self._trails = {side: _Trail() for side in SIDES}
        self._steps = {side: _Steps(scene, side, foot) for side in SIDES}
        self._line = scene.add_line_segments(
            f"{ROOM}/trails",
            self._points(0.0),
            (0, 0, 0),
            thickness=_PIXELS,
            thickness_units="screen",
        )
        self._sent_s = 0.0

    def clear(self) -> None:
        """Clear footprints and trails for a new walk."""
        for side in SIDES:
            self._trails[side] = _Trail()
            self._steps[side].clear()
        draw_lines(self._line, self._points(0.0))
        self._sent_s = 0.0

    def push(self, t_s: float, side: Side, sole: Floats, q: Floats, contact: bool | None) -> None:
        """Update with the position of the middle of the sole (3,) and the orientation of the foot (4,)."""
        x, y, z = sole.tolist()
        self._trails[side].push(t_s, (x, y, max(z, CLEAR_M)))
        if contact is not None:
            self._steps[side].push(t_s, (x, y, z), q, contact)

    def lose(self) -> None:
        """Interrupt the trail and end the contact of a foot with missing samples."""
        for side in SIDES:
            self._trails[side].lose()
            self._steps[side].lose()

    def send(self, t_s: float) -> None:
        """Send the trails if the last transmission was `EVERY_S` ago."""
        if t_s - self._sent_s >= EVERY_S:
            self._sent_s = t_s
            draw_lines(self._line, self._points(t_s))

    def set_dark(self, dark: bool) -> None:
        """Change the colours to the theme of the embedding page."""
        for side in SIDES:
            self._steps[side].node.batched_colors = np.array(to_linear_rgb(TINTS[dark][side]), np.uint8)
        # like those of instances: viser interprets one colour for all lines as sRGB, individual ones as
        # linear
        rows = [np.full((PIECES, 2, 3), to_linear_rgb(TINTS[dark][side]), np.uint8) for side in SIDES]
        self._line.colors = np.concatenate(rows)

    def _points(self, t_s: float) -> Single:
        return np.concatenate([self._trails[side].pieces(t_s - TRAIL_S) for side in SIDES])


class _Trail:
    """A fixed number of line segments; unused ones have zero length."""

    def __init__(self) -> None:
        self._t_s = np.full(PIECES, -np.inf)
        self._pieces = np.zeros((PIECES, 2, 3), np.float32)
        self._next = 0
        self._last: Vector | None = None

    def push(self, t_s: float, point: Vector) -> None:
        if self._last is None:
            self._last = point
        elif dist(point, self._last) >= PIECE_M:
            self._t_s[self._next] = t_s
            self._pieces[self._next] = self._last, point
            self._next = (self._next + 1) % PIECES
            self._last = point

    def lose(self) -> None:
        self._last = None

    def pieces(self, since_s: float) -> Single:
        return np.where((self._t_s >= since_s)[:, None, None], self._pieces, _GONE)


class _Steps:
    """Footprints of one foot: shown at the first rest, corrected at the end of the contact."""

    def __init__(self, scene: viser.SceneApi, side: Side, foot: float) -> None:
        self._position = np.zeros((PRINTS, 3), np.float32)
        self._wxyz = np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (PRINTS, 1))
        self._scale = np.zeros(PRINTS, np.float32)
        self.node = scene.add_batched_meshes_simple(
            f"{ROOM}/prints_{side}",
            *shapes.make_footprint(foot, side),
            self._wxyz,
            self._position,
            batched_scales=self._scale,
            batched_colors=to_linear_rgb(TINTS[False][side]),
            opacity=_OPACITY,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        self._next = 0
        self._shown: int | None = None
        self._slowest = np.inf
        self._rest: tuple[Vector, Floats] = ((0.0, 0.0, 0.0), np.array([1.0, 0.0, 0.0, 0.0]))
        self._before: deque[tuple[float, Vector]] = deque()

    def clear(self) -> None:
        self._scale[:] = 0.0
        self.node.batched_scales = self._scale
        self._next = 0
        self.lose()

    def lose(self) -> None:
        self._lift()
        self._before.clear()

    def push(self, t_s: float, sole: Vector, q: Floats, contact: bool) -> None:
        self._before.append((t_s, sole))
        while len(self._before) > 1 and self._before[1][0] <= t_s - REST_S:
            self._before.popleft()
        if not contact:
            self._lift()
            return
        since, was = self._before[0]
        if t_s - since < 0.5 * REST_S:
            return
        speed = dist(sole, was) / (t_s - since)
        if speed < self._slowest:
            self._slowest = speed
            self._rest = sole, q
            if speed < REST_MPS and self._shown is None:
                self._print()

    def _print(self) -> None:
        """Show a footprint at rest; while the foot keeps moving, its last print is updated."""
        last = (self._next - 1) % PRINTS
        place = self._rest[0]
        is_same = self._scale[last] > 0 and np.hypot(*(self._position[last] - place)[:2]) <= SAME_M
        self._shown = last if is_same else self._next
        if not is_same:
            self._next = (self._next + 1) % PRINTS
        self._put(self._shown)

    def _lift(self) -> None:
        """At the end of a contact, move the print to the position of lowest speed."""
        if self._shown is not None:
            self._put(self._shown)
        elif np.isfinite(self._slowest):
            self._print()  # it never rested: use the moment of lowest speed
        self._shown, self._slowest = None, np.inf

    def _put(self, k: int) -> None:
        place, turn = self._rest[0], float(rotation.yaw(self._rest[1]))
        self._position[k] = (place[0], place[1], CLEAR_M)
        self._wxyz[k] = rotation.about(2, turn)
        move_copies(self.node, self._wxyz.copy(), self._position.copy())
        if self._scale[k] == 0.0:
            self._scale[k] = 1.0
            self.node.batched_scales = self._scale
