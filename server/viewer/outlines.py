"""Visible outlines of a closed mesh: its surfaces, and their edges in a projection."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sagittal.core.frames import Bools, Floats
from sagittal.server.viewer.shapes import Mesh


def split_surfaces(mesh: Mesh) -> Iterator[Mesh]:
    """Yield each closed surface of a mesh as a mesh."""
    vertices, faces = mesh
    surface, before = np.arange(len(vertices)), None
    while before is None or (surface != before).any():  # each vertex takes the least number of its faces
        before = surface
        surface = surface.copy()
        np.minimum.at(surface, faces, before[faces].min(axis=1)[:, None])
    for k in np.unique(surface):
        mine = surface == k
        yield vertices[mine], (np.cumsum(mine) - 1)[faces[mine[faces[:, 0]]]].astype(np.uint32)


def find_front(seen: Floats, mesh: Mesh) -> Bools:
    """Mask of front faces (m,); `seen` (n, 2): projected vertices, right and up."""
    a, b, c = (seen[mesh[1][:, k]] for k in range(3))
    return np.asarray((b - a)[:, 0] * (c - a)[:, 1] > (b - a)[:, 1] * (c - a)[:, 0])


def trace_edges(faces: Mesh, shown: Bools) -> list[list[int]]:
    """Return closed polylines around the visible faces, which lie to their left.

    Filled with the "nonzero" rule, they cover the same area as the faces, including folds.
    """
    triangles = faces[1][shown].astype(np.int64)
    directed = np.concatenate((triangles[:, :2], triangles[:, 1:], triangles[:, ::2][:, ::-1]))
    count = len(faces[0])
    forth, back = directed @ (count, 1), directed @ (1, count)
    after: dict[int, list[int]] = {}
    for a, b in directed[~np.isin(forth, back)].tolist():
        after.setdefault(a, []).append(b)
    lines = []
    while after:
        line = [next(iter(after))]
        while line[-1] in after:
            at = line[-1]
            line.append(after[at].pop())
            if not after[at]:
                del after[at]
        lines.append(line[:-1])
    return lines
