"""First frame of a replay as an SVG drawing, from the initial camera of the 3D view.

It is displayed in the page until the 3D view has rendered, which takes seconds without a graphics processor.
It shows the same parts in the same places: avatar, shadow, footprints and trails, and floor lines.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.frames import Bools, Floats
from sagittal.server.viewer.batches import ARMS, FAINT
from sagittal.server.viewer.body_parts import PartName
from sagittal.server.viewer.colours import Tint
from sagittal.server.viewer.few_poses import find_matrices
from sagittal.server.viewer.motion import ReplayMotion
from sagittal.server.viewer.outlines import find_front, split_surfaces, trace_edges
from sagittal.server.viewer.replay.replay_floor import CHUNK, RECENT_PRINTS
from sagittal.server.viewer.room import FOV_RAD, CameraShot, frame_person
from sagittal.server.viewer.shapes import Mesh, make_footprint

HEIGHT: Final = 500
"""Height of the drawing in units; the width of the picture is arbitrary."""

SHADOW: Final = np.array([-0.2, -0.2])
"""Position of the shadow of a point 1 m above the floor, m: viser's own lamp, in room axes."""

LINES_M: Final = 7
"""Extent of the floor lines to each side of the person."""

_NEAREST_M: Final = 0.6
_EVERY: Final = 2
"""One in this many segments of a trail is drawn."""

_OFF: Final = 0.7
"""Tolerance of line simplification in units."""

_DEFS: Final = (
    "<defs>"
    + "".join(
        f'<linearGradient id="fp-{k}"><stop offset=".5"/><stop offset="1"/></linearGradient>' for k in "lrb"
    )
    + '<linearGradient id="fp-far" gradientUnits="userSpaceOnUse" x1="0" x2="0" y1="-60" y2="250">'
    '<stop stop-opacity="0"/><stop offset="1"/></linearGradient></defs>'
)
"""The lamp shines from above and ahead, and the floor fades in the distance."""
_CSS: Final[dict[Tint, str]] = {"left": "fp-l", "right": "fp-r", "body": "fp-b", "ring": "fp-g"}


@dataclass(frozen=True, eq=False)
class _SeenSurface:
    """A closed surface in the picture: vertices (n, 2), depth (n,) m, and front faces."""

    name: PartName
    css: str
    opacity: float
    mesh: Mesh
    seen: Floats
    depth: Floats
    shown: Bools
    shadow: Floats | None


def draw_first_picture(motion: ReplayMotion, t_s: float) -> str | None:
    """Draw the frame nearest to a time like `ReplayFigure`; None if there is no avatar at that time.

    Returns
    -------
    An SVG that fills the height of its container, centred; at other widths it is cropped or shows more floor.
    """
    frame = motion.index(t_s)
    if not motion.valid[frame]:
        return None
    camera = _Camera(frame_person(motion.size, motion.facing))
    place = np.append(motion.root[frame], 0.0)
    surfaces = list(_see_surfaces(motion, frame, place, camera))
    middle = (motion.root.min(axis=0) + motion.root.max(axis=0)) / 2 - place[:2]
    shadows = [
        _draw(s.mesh, s.shadow, find_front(s.shadow, s.mesh)) for s in surfaces if s.shadow is not None
    ]
    parts = [
        f'<path class="fp-lines" d="{_draw_floor(camera, middle)}"/>',
        *_draw_trails(motion, frame, place, camera),
        *_draw_prints(motion, frame, place, camera),
        f'<path class="fp-shadow" d="{"".join(shadows)}"/>',
    ]
    for s in _order(surfaces):
        clear = "" if s.opacity == 1.0 else f' opacity="{s.opacity:g}"'
        parts.append(f'<path class="{s.css}"{clear} d="{_draw(s.mesh, s.seen, s.shown)}"/>')
    return (
        f'<svg class="first-picture" viewBox="-1 {-HEIGHT // 2} 2 {HEIGHT}" aria-hidden="true">'
        f"{_DEFS}{''.join(parts)}</svg>"
    )


class _Camera:
    """Camera of the scene: points (n, 3) m → the picture."""

    def __init__(self, shot: CameraShot) -> None:
        self.eye = np.array(shot.eye)
        sight = np.array(shot.at) - self.eye
        sight /= np.linalg.norm(sight)
        right = np.cross(sight, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        self._axes = np.stack((right, np.cross(right, sight), sight)).T

    def see(self, points: Floats) -> tuple[Floats, Floats]:
        """Project points to positions (n, 2), right and up from the centre, and depth (n,), m."""
        x, up, ahead = ((points - self.eye) @ self._axes).T
        half = np.tan(FOV_RAD / 2) * ahead
        return HEIGHT / 2 * np.column_stack((x, up)) / half[:, None], ahead


def _see_surfaces(motion: ReplayMotion, frame: int, place: Floats, camera: _Camera) -> Iterator[_SeenSurface]:
    for name, batch in motion.batches.items():
        turns = find_matrices(batch.wxyz[frame].astype(np.float64))
        meshes = list(split_surfaces(batch.mesh))
        for k, (tint, measured) in enumerate(zip(batch.tint, batch.measured, strict=True)):
            opacity = ARMS if name == "arms" else 1.0 if measured else FAINT
            for mesh in meshes:
                points = mesh[0] @ turns[k].T + batch.position[frame, k] - place
                projected, depth = camera.see(points)
                shadow = None
                if name not in ("arms", "rings"):
                    fallen = points[:, :2] + points[:, 2:] * SHADOW
                    shadow, _ = camera.see(np.column_stack((fallen, np.zeros(len(fallen)))))
                visible = find_front(projected, mesh)
                if name == "rings":  # their flat ends are inside the leg
                    visible &= np.ptp(mesh[0][mesh[1], 1], axis=1) > 0
                yield _SeenSurface(name, _CSS[tint], opacity, mesh, projected, depth, visible, shadow)


def _order(surfaces: list[_SeenSurface]) -> list[_SeenSurface]:
    """Sort from farthest to nearest, rings after their leg."""
    far = {id(s): float(s.depth.mean()) for s in surfaces}
    leg = next((far[id(s)] for s in surfaces if (s.name, s.css) == ("shanks", _CSS["right"])), 0.0)
    return sorted(surfaces, key=lambda s: (-leg, 1.0) if s.name == "rings" else (-far[id(s)], 0.0))


def _draw_floor(camera: _Camera, middle: Floats) -> str:
    """Lines of the floor every metre, in front of the camera."""
    path = ""
    positions = np.arange(-LINES_M, LINES_M + 1)
    for axis in (0, 1):
        for k in positions + middle[axis] % 1.0:
            ends = np.zeros((2, 3))
            ends[:, axis], ends[:, 1 - axis] = k, (-LINES_M, LINES_M)
            ahead = camera.see(ends)[1]
            if ahead.max() <= _NEAREST_M:
                continue
            if ahead.min() < _NEAREST_M:
                near = int(np.argmin(ahead))
                share = (_NEAREST_M - ahead[near]) / (ahead[1 - near] - ahead[near])
                ends[near] += share * (ends[1 - near] - ends[near])
            path += _write_line(camera.see(ends)[0])
    return path


def _draw_trails(motion: ReplayMotion, frame: int, place: Floats, camera: _Camera) -> Iterator[str]:
    for side, trail in motion.trails.items():
        count = int(np.searchsorted(trail.t_s, motion.t_s[frame], side="right"))
        pieces = trail.pieces[max(0, count // CHUNK - 1) * CHUNK : count]
        if len(pieces):
            points = np.concatenate((pieces[:-1:_EVERY, 0], pieces[-1:, 1])) - place
            projected, ahead = camera.see(points)
            yield f'<path class="fp-way {_CSS[side]}" d="{_write_line(projected[ahead > _NEAREST_M])}"/>'


def _draw_prints(motion: ReplayMotion, frame: int, place: Floats, camera: _Camera) -> Iterator[str]:
    for side, prints in motion.prints.items():
        count = int(np.searchsorted(prints.t_s, motion.t_s[frame], side="right"))
        mesh = make_footprint(motion.body.foot, side)
        path = ""
        for k in range(max(0, count - RECENT_PRINTS), count):
            turn = find_matrices(prints.wxyz[k].astype(np.float64))
            projected, ahead = camera.see(mesh[0] @ turn.T + prints.position[k] - place)
            if ahead.min() > _NEAREST_M:
                path += _draw(mesh, projected, find_front(projected, mesh))
        if path:
            yield f'<path class="fp-print {_CSS[side]}" d="{path}"/>'


def _draw(mesh: Mesh, projected: Floats, visible: Bools) -> str:
    return "".join(f"{_write_line(projected[line])}z" for line in trace_edges(mesh, visible))


def _write_line(points: Floats) -> str:
    """SVG path through rounded points, without negligible vertices; "" for none."""
    if not len(points):
        return ""
    whole = np.rint(points * (1, -1)).astype(int)
    whole = whole[_find_corners(whole.astype(float))]
    steps = np.diff(whole, axis=0)
    steps = steps[(steps != 0).any(axis=1)]
    numbers = " ".join(f"{x} {y}" for x, y in steps.tolist()).replace(" -", "-")
    return f"M{whole[0, 0]} {whole[0, 1]}l{numbers}" if len(steps) else ""


def _find_corners(points: Floats) -> list[int]:
    """Indices of the vertices of a simplified line (Douglas and Peucker 1973,
    doi:10.3138/FM57-6770-U75U-7727).
    """
    indices, spans = {0, len(points) - 1}, [(0, len(points) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        along = points[last] - points[first]
        offsets = points[first + 1 : last] - points[first]
        length = np.hypot(*along)
        off = abs(_turn(along, offsets)) / length if length else np.hypot(*offsets.T)
        k = int(np.argmax(off))
        if off[k] > _OFF:
            middle = first + 1 + k
            indices.add(middle)
            spans += [(first, middle), (middle, last)]
    return sorted(indices)


def _turn(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
