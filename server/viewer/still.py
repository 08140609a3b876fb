"""One frame of the avatar as a drawing for print: outlined parts, seen from one side."""

from __future__ import annotations

from html import escape
from typing import Final

import numpy as np

from sagittal.core.body.poses import Poses
from sagittal.core.frames import Floats, Side
from sagittal.server.viewer.colours import Tint
from sagittal.server.viewer.few_poses import find_matrices
from sagittal.server.viewer.layout import FigureLayout
from sagittal.server.viewer.outlines import find_front, split_surfaces, trace_edges

HEIGHT_PX: Final = 116
WIDEST_PX: Final = 92
CSS: Final[dict[Tint, str]] = {"left": "st-l", "right": "st-r", "body": "st-b", "ring": "st-g"}
FAINT: Final = "st-f"
"""Of parts without a sensor."""


def draw_still(poses: Poses, t_s: float, near: Side, title: str) -> str | None:
    """Draw the avatar at a time; None if a sensor was lost then, or no segment has a pose.

    Parameters
    ----------
    near : leg nearer to the viewer. title : for screen readers.
    """
    frame = min(int(np.searchsorted(poses.t_s, t_s)), len(poses.t_s) - 1)
    segments = tuple(poses.q)
    if not segments or not poses.valid[frame]:
        return None
    q = np.array([[poses.q[s][frame] for s in segments]])
    p = np.array([[poses.p[s][frame] for s in segments]])
    if not (np.isfinite(q).all() and np.isfinite(p).all()):
        return None
    front = find_matrices(q[0, segments.index("pelvis") if "pelvis" in segments else 0])[:2, 0]
    layout = FigureLayout(segments, poses.body, poses.method)
    parts = []
    for batch in layout.divide(layout.place(q, p)).values():
        turns = find_matrices(batch.wxyz[0].astype(np.float64))
        for k, (tint, measured) in enumerate(zip(batch.tint, batch.measured, strict=True)):
            for mesh in split_surfaces(batch.mesh):
                projected, depth = _project(mesh[0] @ turns[k].T + batch.position[0, k], front, near)
                outlines = [projected[line] for line in trace_edges(mesh, find_front(projected, mesh))]
                parts.append((depth, CSS[tint] if measured else f"{CSS[tint]} {FAINT}", outlines))
    parts.sort(key=lambda part: -part[0])
    return _write([(css, outlines) for _, css, outlines in parts if outlines], title)


def _project(points: Floats, front: Floats, near: Side) -> tuple[Floats, float]:
    """Points (n, 2) m, right and up, and their mean distance from the viewer."""
    along = front / np.linalg.norm(front) * (1.0 if near == "right" else -1.0)
    normal = np.array([-along[1], along[0]])  # to the left when looking along `along`
    flat = np.column_stack((points[:, :2] @ along, points[:, 2]))
    return flat, float((points[:, :2] @ normal).mean())


def _write(parts: list[tuple[str, list[Floats]]], title: str) -> str:
    every = np.concatenate([line for _, outlines in parts for line in outlines])
    (left, low), (right, high) = every.min(axis=0), every.max(axis=0)
    low = min(low, 0.0)
    scale = min((HEIGHT_PX - 4) / (high - low), (WIDEST_PX - 4) / (right - left))
    width, height = scale * (right - left) + 4, scale * (high - low) + 4
    drawn = []
    for css, outlines in parts:
        path = ""
        for line in outlines:
            x, y = 2 + scale * (line[:, 0] - left), 2 + scale * (high - line[:, 1])
            path += f"M{'L'.join(f'{a:.1f} {b:.1f}' for a, b in zip(x, y, strict=True))}z"
        drawn.append(f'<path class="{css}" d="{path}"/>')
    floor = 2 + scale * high
    return (
        f'<svg class="chart still" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.1f} {height:.1f}" role="img"><title>{escape(title)}</title>'
        f'<line class="ax" x1="0" x2="{width:.1f}" y1="{floor:.1f}" y2="{floor:.1f}"/>{"".join(drawn)}</svg>'
    )
