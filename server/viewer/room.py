"""Scene around an avatar: floor, light, background and camera.

Everything with a position in the room is attached to one node. Following the avatar moves that node rather
than the camera, so that it does not interfere with the user's control of the camera.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import viser

from sagittal.core.frames import Floats
from sagittal.server.viewer.colours import BACKGROUND, FLOOR
from sagittal.server.viewer.viser_adapter import gather_longer, move_node

ROOM: Final = "/room"
"""Name of the parent node of everything."""
SKY: Final = "/sky"
"""Name of the ambient light."""

ViewName = Literal["near", "right", "left", "front", "top"]

Vector = tuple[float, float, float]

VIEWS: Final[Mapping[ViewName, Vector]] = {
    "near": (1.9, -3.4, 1.75),
    "right": (0.0, -4.0, 0.92),
    "left": (0.0, 4.0, 0.92),
    "front": (4.0, 0.0, 1.0),
    # straight from above there is no upward direction in the picture; from behind, so that the walk goes up
    # in it
    "top": (-0.6, 0.0, 5.0),
}
"""Camera positions for a person facing x, m; "near" is from the right and slightly from ahead."""

FOV_RAD: Final = float(np.deg2rad(31.0))
FLOOR_M: Final = 60.0


@dataclass(frozen=True)
class CameraShot:
    """Camera in m: target and eye; fade and section are extent and spacing of the floor lines."""

    at: Vector
    eye: Vector
    fade: float
    section: float


class SceneRoom:
    """An empty scene in a dedicated viser server.

    Parameters
    ----------
    floor_m : length of the floor. middle : (2,) m, its centre.
    """

    def __init__(
        self, server: viser.ViserServer, floor_m: float = FLOOR_M, middle: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self._server = server
        gather_longer(server)
        scene = server.scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.configure_default_lights(True, cast_shadow=True)
        # ambient light is one lamp: the default, an environment map, must first be filtered by the browser,
        # three quarters of the work of a first frame without a graphics processor
        scene.configure_environment_map(None)
        scene.add_light_hemisphere(
            SKY, sky_color=(255, 255, 255), ground_color=(200, 200, 205), intensity=2.4
        )
        self._node = scene.add_frame(ROOM, show_axes=False)
        self._place: Vector = (0.0, 0.0, 0.0)
        self._grid = scene.add_grid(
            f"{ROOM}/floor", floor_m, floor_m, shadow_opacity=0.2, position=(*middle, 0.0)
        )
        server.initial_camera.fov = FOV_RAD

    def bring(self, x: float, y: float) -> None:
        """Move a position on the floor, m, to the camera target."""
        place = (-x, -y, 0.0)
        if place != self._place:
            self._place = place
            move_node(self._node, place)

    def look(self, shot: CameraShot) -> None:
        """Set the cameras of current and future clients."""
        self._grid.fade_distance = shot.fade
        self._grid.section_size, self._grid.cell_size = shot.section, shot.section / 5
        initial = self._server.initial_camera
        initial.position, initial.look_at = shot.eye, shot.at
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = shot.eye, shot.at

    def set_dark(self, dark: bool) -> None:
        """Change to the theme of the embedding page."""
        self._server.scene.set_background_image(np.full((2, 2, 3), BACKGROUND[dark], np.uint8), format="png")
        self._grid.cell_color, self._grid.section_color = FLOOR[dark]
        self._server.gui.configure_theme(dark_mode=dark, show_logo=False, show_share_button=False)


def frame_person(size: float, facing: float, view: ViewName = "near") -> CameraShot:
    """Return a camera with the whole avatar in view.

    Parameters
    ----------
    size : leg length relative to 0.9 m. facing : heading, rad.
    """
    x, y, z = size * (turn_about_vertical(facing) @ np.array(VIEWS[view]))
    return CameraShot((0.0, 0.0, 0.86 * size), (float(x), float(y), float(z)), fade=12.0, section=1.0)


def turn_about_vertical(heading: float) -> Floats:
    """Return the rotation matrix (3, 3) by a heading in rad about the vertical."""
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
