"""Surfaces of a mesh one by one, and their edges in a picture."""

from __future__ import annotations

import numpy as np

from sagittal.core.frames import Floats
from sagittal.server.viewer.outlines import find_front, split_surfaces, trace_edges
from sagittal.server.viewer.shapes import Mesh, loft_sections

ROWS = np.array([[0.0, 0.0, 1.0, 1.0, 1.0], [2.0, 0.0, 1.0, 1.0, 1.0]])


def tube(x: float = 0.0) -> Mesh:
    vertices, faces = loft_sections(ROWS, 8)
    return (vertices + np.array([x, 0, 0], np.float32)).astype(np.float32), faces


def joined(*meshes: Mesh) -> Mesh:
    """Several surfaces as one mesh, their faces in turn."""
    starts = np.cumsum([0, *(len(v) for v, _ in meshes)])[:-1]
    faces = np.concatenate([f + start for (_, f), start in zip(meshes, starts, strict=True)])
    order = np.random.default_rng(3).permutation(len(faces))
    return np.concatenate([v for v, _ in meshes]), faces[order].astype(np.uint32)


def test_each_closed_surface_is_a_mesh_of_its_own() -> None:
    parts = list(split_surfaces(joined(tube(), tube(5.0), tube(10.0))))
    assert [round(float(v[:, 0].mean())) for v, _ in parts] == [0, 5, 10]
    for (vertices, faces), x in zip(parts, (0.0, 5.0, 10.0), strict=True):
        expected, triangles = tube(x)
        np.testing.assert_array_equal(vertices, expected)
        assert {tuple(f) for f in faces.tolist()} == {tuple(f) for f in triangles.tolist()}
        assert faces.dtype == np.uint32
    assert len(list(split_surfaces(tube()))) == 1


def test_a_face_looks_at_who_sees_it_turn_left() -> None:
    mesh: Mesh = (np.zeros((3, 3), np.float32), np.array([[0, 1, 2], [0, 2, 1], [0, 0, 1]], np.uint32))
    values = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    assert find_front(values, mesh).tolist() == [True, False, False]


def area(line: list[int], observations: Floats) -> float:
    x, y = observations[line].T
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def test_the_edge_goes_once_around_what_is_seen_with_it_to_the_left() -> None:
    mesh = tube()
    astype = mesh[0][:, :2].astype(np.float64)
    front = find_front(astype, mesh)
    (line,) = trace_edges(mesh, front)
    assert len(set(line)) == len(line)
    width = np.ptp(astype[:, 0])
    np.testing.assert_allclose(area(line, astype), width * 2.0, rtol=0.01)


def test_faces_apart_have_lines_of_their_own_and_none_has_none() -> None:
    mesh: Mesh = (np.zeros((6, 3), np.float32), np.array([[0, 1, 2], [3, 4, 5]], np.uint32))
    assert trace_edges(mesh, np.array([True, True])) == [[0, 1, 2], [3, 4, 5]]
    assert trace_edges(mesh, np.array([False, True])) == [[3, 4, 5]]
    assert trace_edges(mesh, np.array([False, False])) == []
    square: Mesh = (np.zeros((4, 3), np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    assert trace_edges(square, np.array([True, True])) == [[0, 1, 2, 3]]
