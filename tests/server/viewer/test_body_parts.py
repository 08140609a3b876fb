"""The meshes of the figure: closed, outward, of a size that loads soon, and without gaps at joints."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from sagittal.core.body.model import BodyModel
from sagittal.server.viewer.body_parts import find_toe_bend, locate_ball, make_parts
from sagittal.server.viewer.shapes import Mesh
from tests.server import walk

BODIES = [
    walk.BODY,
    BodyModel.from_height(1.05),
    BodyModel.from_height(2.05),
    BodyModel(hip_width=0.24, thigh=0.36, shank=0.46, ankle_height=0.09, foot=0.3, estimated=False),
]
VERTICES, BYTES = 5_000, 190_000
"""Of the whole figure, at most."""


def normals_of(mesh: Mesh) -> np.ndarray:
    """Normals (m, 3) of the faces, as long as twice their area."""
    v, f = mesh[0].astype(float), mesh[1].astype(int)
    return np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]])


def volume_of(mesh: Mesh) -> float:
    """Signed volume, m³: above 0 where the faces of closed surfaces look outwards."""
    v, f = mesh[0].astype(float), mesh[1].astype(int)
    return float(np.einsum("ij,ij->", v[f[:, 0]], np.cross(v[f[:, 1]], v[f[:, 2]])) / 6.0)


@pytest.mark.parametrize("body", BODIES)
def test_every_part_is_a_closed_surface_that_looks_outwards(body: BodyModel) -> None:
    for name, mesh in make_parts(body).items():
        vertices, faces = mesh
        assert np.isfinite(vertices).all(), name
        assert faces.max() < len(vertices), name
        edges = [(int(f[k]), int(f[(k + 1) % 3])) for f in faces for k in range(3)]
        assert max(Counter(edges).values()) == 1, name  # each edge once one way
        assert {(b, a) for a, b in edges} == set(edges), name  # and once the other
        assert volume_of(mesh) > 0, name
        assert np.linalg.norm(normals_of(mesh), axis=1).min() > 0, name


@pytest.mark.parametrize("body", BODIES)
def test_a_figure_has_few_vertices_and_loads_soon(body: BodyModel) -> None:
    parts = make_parts(body).values()
    assert sum(len(v) for v, _ in parts) <= VERTICES
    assert sum(v.nbytes + f.nbytes for v, f in parts) <= BYTES


@pytest.mark.parametrize("flexion_deg", [0, 30, 60, 90, 120])
def test_a_knee_stays_closed_however_far_it_bends(flexion_deg: float) -> None:
    """From any side in the sagittal plane one meets skin nearly as far out as the joint is thick."""
    parts, body = make_parts(walk.BODY), walk.BODY
    thigh = parts["thighs"][0].astype(float) + np.array([0.0, body.thigh, 0.0])  # about the knee
    a = np.radians(-flexion_deg)
    turn = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    shank = parts["shanks"][0].astype(float) @ turn.T
    radius = 0.028 * body.thigh / 0.245  # of the thinner of the two domes
    # wherever one looks into the joint from the sagittal plane, something lies at least so far out
    for degrees in range(0, 360, 10):
        way = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
        reach = max(
            float(np.max(np.where(np.linalg.norm(np.cross(v, way), axis=1) < 0.012, v @ way, 0.0)))
            for v in (thigh, shank)
        )
        assert reach >= 0.9 * radius, degrees


def test_limbs_meet_at_a_joint_with_domes_of_nearly_one_size() -> None:
    parts, body = make_parts(walk.BODY), walk.BODY
    lower_thigh = parts["thighs"][0][parts["thighs"][0][:, 1] < -body.thigh]
    upper_shank = parts["shanks"][0][parts["shanks"][0][:, 1] > 0]
    a = np.linalg.norm(lower_thigh + np.array([0, body.thigh, 0]), axis=1)
    b = np.linalg.norm(upper_shank, axis=1)
    assert 0.75 * a.max() < b.max() < a.max()  # the shank's dome turns inside the thigh's
    assert a.min() > 0.9 * b.min()


@pytest.mark.parametrize("pitch_deg", [-60.0, -30.0, 0.0, 20.0])
@pytest.mark.parametrize("height_m", [0.019, 0.03, 0.08])
def test_toes_bend_as_far_as_the_floor_asks_and_no_farther(pitch_deg: float, height_m: float) -> None:
    body = walk.BODY
    pitch = np.radians(pitch_deg)
    bend = float(find_toe_bend(body, np.array(pitch), np.array(height_m)))
    assert 0.0 <= bend <= np.radians(65.0)
    vertices = make_parts(body)["toes_r"][0].astype(float)
    # toes that are long and flat: their tip's height over the floor
    lowest = height_m + (vertices[:, 0] * np.sin(pitch + bend) + vertices[:, 1] * np.cos(pitch + bend)).min()
    assert lowest > -0.012
    if bend > 0.01:
        assert lowest < 0.012  # no farther than needed


def test_the_ball_lies_between_sole_and_instep() -> None:
    x, y, z = locate_ball(walk.BODY)
    assert 0.4 * walk.BODY.foot < x < 0.5 * walk.BODY.foot
    assert z == 0.0
    assert -walk.BODY.ankle_height < y < 0.0
