"""Floor marks of a replay up to a given time: footprints and trails of the feet.

A trail is divided into chunks that are sent once and then only made visible; at any time only the incomplete
chunk is sent, so that the cost of a frame does not grow with the length of the trial. In close-up only the
last strides are shown, since many passes through a corridor would overlap.
"""

from __future__ import annotations

import numpy as np
import viser

from sagittal.core.frames import Side
from sagittal.server.viewer import shapes
from sagittal.server.viewer.colours import TINTS, Rgb, to_linear_rgb
from sagittal.server.viewer.motion import ReplayMotion
from sagittal.server.viewer.steps import FootPrints, FootTrail, Single

CHUNK = 256
"""Segments of a trail per scene node, about eight strides."""

RECENT_PRINTS = 12
"""Footprints per side in close-up; of a trail the last complete chunk and the incomplete one."""

_PIXELS = 1.6
_OPACITY = 0.6


class ReplayFloor:
    """Footprints and trails of a motion in one scene.

    Parameters
    ----------
    parent : name of the scene node of the room.
    """

    def __init__(self, scene: viser.SceneApi, parent: str, motion: ReplayMotion) -> None:
        self._all = scene.add_frame(f"{parent}/ground", show_axes=False)
        under, length = self._all.name, motion.body.foot
        parts: list[_Prints | _Trail] = [
            *(_Prints(scene, under, s, x, length) for s, x in motion.prints.items() if len(x.t_s)),
            *(_Trail(scene, under, s, x) for s, x in motion.trails.items() if len(x.t_s)),
        ]
        self._shown = dict.fromkeys(parts, (0, True))

    def show(self, t_s: float, recent: bool) -> None:
        """Show the marks up to a time, all of them or the last strides."""
        for part, state in self._shown.items():
            count = int(np.searchsorted(part.t_s, t_s, side="right"))
            if (count, recent) != state:
                part.show(count, recent)
                self._shown[part] = (count, recent)

    def set_dark(self, dark: bool) -> None:
        """Change the colours to the theme of the embedding page."""
        for part in self._shown:
            part.paint(TINTS[dark][part.side])

    def set_visible(self, visible: bool) -> None:
        """Show or hide everything."""
        self._all.visible = visible


class _Prints:
    def __init__(
        self, scene: viser.SceneApi, parent: str, side: Side, prints: FootPrints, length: float
    ) -> None:
        self.side, self.t_s = side, prints.t_s
        self._node = scene.add_batched_meshes_simple(
            f"{parent}/prints_{side}",
            *shapes.make_footprint(length, side),
            prints.wxyz,
            prints.position,
            batched_scales=np.zeros(len(prints.t_s), np.float32),
            batched_colors=to_linear_rgb(TINTS[False][side]),
            opacity=_OPACITY,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

    def paint(self, colour: Rgb) -> None:
        self._node.batched_colors = np.array(to_linear_rgb(colour), np.uint8)

    def show(self, count: int, recent: bool) -> None:
        scales = np.zeros(len(self.t_s), np.float32)
        scales[max(0, count - RECENT_PRINTS) if recent else 0 : count] = 1.0
        self._node.batched_scales = scales


class _Trail:
    def __init__(self, scene: viser.SceneApi, parent: str, side: Side, trail: FootTrail) -> None:
        self.side, self.t_s, self._pieces = side, trail.t_s, trail.pieces
        self._seen: set[int] = set()

        def node(name: str, pieces: Single) -> viser.LineSegmentsHandle:
            return scene.add_line_segments(
                f"{parent}/trail_{side}_{name}",
                pieces,
                TINTS[False][side],
                thickness=_PIXELS,
                thickness_units="screen",
                visible=False,
            )

        whole = range(0, len(self.t_s) - CHUNK + 1, CHUNK)
        self._chunks = [node(str(k), self._pieces[k : k + CHUNK]) for k in whole]
        self._rest = node("rest", self._pieces[:1])

    def paint(self, colour: Rgb) -> None:
        for node in (*self._chunks, self._rest):
            node.colors = np.array(colour, np.uint8)

    def show(self, count: int, recent: bool) -> None:
        done = count // CHUNK
        chunks = set(range(max(0, done - 1) if recent else 0, done))
        for k in chunks ^ self._seen:
            self._chunks[k].visible = k in chunks
        self._seen = chunks
        self._rest.visible = count > done * CHUNK
        if self._rest.visible:
            self._rest.points = self._pieces[done * CHUNK : count]
