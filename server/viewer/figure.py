"""A prepared motion as a viser scene: three batched meshes, footprints, two letters, a floor that moves."""

from __future__ import annotations

import numpy as np
import viser

from server.viewer import shapes
from server.viewer.motion import PRINTS_PER_SIDE, Motion, Single, Tint

Rgb = tuple[int, int, int]

TINTS: dict[Tint, Rgb] = {
    "left": (0xD5, 0x5E, 0x00),
    "right": (0x00, 0x72, 0xB2),
    "body": (0x6B, 0x76, 0x82),
    "joint": (0xEC, 0xEE, 0xF1),
}
"""sRGB; the leg pair is that of the charts (experience.md)."""

BACKGROUND: dict[bool, Rgb] = {False: (0xF9, 0xFA, 0xFB), True: (0x16, 0x1C, 0x22)}
"""Dark → colour behind the figure."""

_FLOOR: dict[bool, tuple[Rgb, Rgb]] = {
    False: ((0xE2, 0xE6, 0xEA), (0xC2, 0xCA, 0xD2)),
    True: ((0x2A, 0x32, 0x3B), (0x45, 0x50, 0x5C)),
}
_SECTION_M = 1.0
_NOWHERE = -50.0
_FOV_RAD = np.deg2rad(31.0)


def linear(colour: Rgb) -> Rgb:
    """Turn sRGB into the linear RGB that viser expects per instance of a batch (0 to 255).

    A colour per mesh is taken as sRGB, a colour per instance is not: unconverted it looks washed out.
    Formula: IEC 61966-2-1.
    """
    c = np.asarray(colour) / 255.0
    out = np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92)
    r, g, b = (round(float(v) * 255) for v in out)
    return r, g, b


class Figure:
    """One person in one viser server.

    Parameters
    ----------
    server : a viser server of its own.
    motion : prepared by `server.viewer.motion.prepare`.
    """

    def __init__(self, server: viser.ViserServer, motion: Motion, dark: bool = False) -> None:
        self._server, self._motion = server, motion
        scene = server.scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.configure_default_lights(True, cast_shadow=True)
        self._grid = scene.add_grid(
            "/floor",
            infinite_grid=True,
            cell_size=0.25,
            section_size=_SECTION_M,
            fade_distance=12.0,
            shadow_opacity=0.2,
        )
        self._batches = [
            (b, _add_batch(scene, f"/{name}", b.mesh, b.wxyz[0], b.position[0], b.scale, b.tint))
            for name, b in motion.batches.items()
            if b.tint
        ]
        self._prints = _add_prints(scene, motion)
        self._letters = {
            side: scene.add_label(
                f"/letter_{side}", side[0].upper(), font_screen_scale=1.3, anchor="center-left"
            )
            for side in motion.toes
        }
        self._aim_camera()
        self.set_dark(dark)
        self.pose(float(motion.t_s[0]))

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
        valid = bool(m.valid[i])
        shift = np.array([-m.root[i, 0], -m.root[i, 1], 0.0], np.float32)
        with self._server.atomic():
            for batch, handle in self._batches:
                handle.visible = valid
                if valid:
                    handle.batched_positions = batch.position[i] + shift
                    handle.batched_wxyzs = batch.wxyz[i]
            for side, letter in self._letters.items():
                letter.visible = valid
                x, y, z = (float(v) for v in m.toes[side][i] + shift)
                letter.position = (x, y, z)
            x, y = (float(v) for v in shift[:2] % _SECTION_M)
            self._grid.position = (x, y, 0.0)
            if self._prints is not None:
                self._prints.batched_positions = self._print_places(float(m.t_s[i]), shift)
        self._server.flush()
        return float(m.t_s[i])

    def set_dark(self, dark: bool) -> None:
        """Change background, floor and letters to the theme of the page around."""
        self._server.scene.set_background_image(np.full((2, 2, 3), BACKGROUND[dark], np.uint8), format="png")
        self._grid.cell_color, self._grid.section_color = _FLOOR[dark]
        self._server.gui.configure_theme(dark_mode=dark, show_logo=False, show_share_button=False)
        self._server.flush()

    def _aim_camera(self) -> None:
        """Look from the right and slightly from ahead, the whole person in the picture."""
        size = self._motion.size
        c, s = np.cos(self._motion.facing), np.sin(self._motion.facing)
        x, y, z = 1.9 * size, -3.4 * size, 1.35 * size
        camera = self._server.initial_camera
        camera.position = (float(c * x - s * y), float(s * x + c * y), float(z))
        camera.look_at = (0.0, 0.0, 0.86 * size)
        camera.fov = float(_FOV_RAD)

    def _print_places(self, t_s: float, shift: Single) -> Single:
        places = np.full((2 * PRINTS_PER_SIDE, 3), _NOWHERE, np.float32)
        for k, side in enumerate(self._motion.prints):
            start, place = self._motion.prints[side]
            last = int(np.searchsorted(start, t_s, side="right"))
            seen = place[max(0, last - PRINTS_PER_SIDE) : last]
            rows = slice(k * PRINTS_PER_SIDE, k * PRINTS_PER_SIDE + len(seen))
            places[rows, :2] = seen + shift[:2]
            places[rows, 2] = 0.003
        return places


def _add_batch(
    scene: viser.SceneApi,
    name: str,
    mesh: shapes.Mesh,
    wxyz: Single,
    position: Single,
    scale: Single,
    tint: tuple[Tint, ...],
) -> viser.BatchedMeshHandle:
    colours = np.array([linear(TINTS[t]) for t in tint], np.uint8)
    return scene.add_batched_meshes_simple(
        name,
        *mesh,
        wxyz,
        position,
        batched_scales=scale,
        batched_colors=colours,
        lod="off",
        receive_shadow=False,
    )


def _add_prints(scene: viser.SceneApi, motion: Motion) -> viser.BatchedMeshHandle | None:
    if not motion.prints:
        return None
    n = 2 * PRINTS_PER_SIDE
    tints = [side for side in motion.prints for _ in range(PRINTS_PER_SIDE)]
    colours = np.array([linear(TINTS[t]) for t in tints] + [(0, 0, 0)] * (n - len(tints)), np.uint8)
    return scene.add_batched_meshes_simple(
        "/prints",
        *shapes.disc(),
        np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (n, 1)),
        np.full((n, 3), _NOWHERE, np.float32),
        batched_scales=np.full(n, 0.055 * motion.size, np.float32),
        batched_colors=colours,
        opacity=0.45,
        lod="off",
        cast_shadow=False,
        receive_shadow=False,
    )
