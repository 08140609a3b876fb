"""Visible outlines of a closed mesh: its surfaces, and their edges in a projection."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sagittal.core.frames import Bools, Floats
from sagittal.server.viewer.shapes import Mesh


def split_surfaces(mesh: Mesh) -> Iterator[Mesh]:
    """Yield each closed surface of a mesh as a mesh."""
    vertices, faces = mesh
    surface, previous = np.arange(len(vertices)), None
    # each vertex takes the smallest label of its faces
    while previous is None or (surface != previous).any():
        previous = surface
        surface = surface.copy()
        np.minimum.at(surface, faces, previous[faces].min(axis=1)[:, None])
    for k in np.unique(surface):
        mine = surface == k
        yield vertices[mine], (np.cumsum(mine) - 1)[faces[mine[faces[:, 0]]]].astype(np.uint32)


def find_front(projected: Floats, mesh: Mesh) -> Bools:
    """Mask of front faces (m,); `projected` (n, 2): projected vertices, right and up."""
    a, b, c = (projected[mesh[1][:, k]] for k in range(3))
    return np.asarray((b - a)[:, 0] * (c - a)[:, 1] > (b - a)[:, 1] * (c - a)[:, 0])


def trace_edges(faces: Mesh, visible: Bools) -> list[list[int]]:
    """Return closed polylines around the visible faces, which lie to their left.

    Filled with the "nonzero" rule, they cover the same area as the faces, including folds.
    """
    triangles = faces[1][visible].astype(np.int64)
    directed = np.concatenate((triangles[:, :2], triangles[:, 1:], triangles[:, ::2][:, ::-1]))
    count = len(faces[0])
    forth, back = directed @ (count, 1), directed @ (1, count)
    successors: dict[int, list[int]] = {}
    for a, b in directed[~np.isin(forth, back)].tolist():
        successors.setdefault(a, []).append(b)
    lines = []
    while successors:
        line = [next(iter(successors))]
        while line[-1] in successors:
            vertex = line[-1]
            line.append(successors[vertex].pop())
            if not successors[vertex]:
                del successors[vertex]
        lines.append(line[:-1])
    return lines
