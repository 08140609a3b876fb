"""The algebra of rotations: group axioms, and that all representations say the same."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sagittal.core import rotation
from sagittal.core.frames import Floats
from sagittal.core.rotation import compiled

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def _unit(x: Floats) -> Floats:
    n = np.linalg.norm(x)
    return np.array([1.0, 0.0, 0.0, 0.0]) if n < 1e-3 else np.asarray(x / n)


components = st.floats(-1.0, 1.0, allow_nan=False, width=64)
quaternions = arrays(np.float64, 4, elements=components).map(_unit)
vectors = arrays(np.float64, 3, elements=st.floats(-10.0, 10.0, allow_nan=False, width=64))


def same_rotation(p: Floats, q: Floats, tolerance: float = 1e-9) -> bool:
    return bool(min(np.abs(p - q).max(), np.abs(p + q).max()) < tolerance)


@given(quaternions, quaternions, quaternions)
def test_multiplication_is_associative(p: Floats, q: Floats, r: Floats) -> None:
    left = rotation.multiply(rotation.multiply(p, q), r)
    np.testing.assert_allclose(left, rotation.multiply(p, rotation.multiply(q, r)), atol=1e-12)


@given(quaternions)
def test_identity_and_inverse_exist(q: Floats) -> None:
    np.testing.assert_allclose(rotation.multiply(q, IDENTITY), q, atol=1e-15)
    np.testing.assert_allclose(rotation.multiply(q, rotation.conjugate(q)), IDENTITY, atol=1e-12)


@given(quaternions, quaternions, vectors)
def test_composition_rotates_right_factor_first(p: Floats, q: Floats, v: Floats) -> None:
    together = rotation.rotate(rotation.multiply(p, q), v)
    np.testing.assert_allclose(together, rotation.rotate(p, rotation.rotate(q, v)), atol=1e-11)


@given(quaternions, vectors)
def test_rotation_keeps_length_and_equals_its_matrix(q: Floats, v: Floats) -> None:
    rotated = rotation.rotate(q, v)
    assert abs(np.linalg.norm(rotated) - np.linalg.norm(v)) < 1e-11
    np.testing.assert_allclose(rotated, rotation.to_matrix(q) @ v, atol=1e-11)


@given(quaternions)
def test_matrix_round_trip(q: Floats) -> None:
    R = rotation.to_matrix(q)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert abs(np.linalg.det(R) - 1.0) < 1e-12
    assert same_rotation(rotation.from_matrix(R), q)


@given(vectors.map(lambda v: v * (3.0 / 17.4)))
def test_exp_and_log_are_inverse_within_half_a_turn(phi: Floats) -> None:
    np.testing.assert_allclose(rotation.log(rotation.exp(phi)), phi, atol=1e-9)


@given(st.floats(-12.0, -3.0))
def test_exp_and_log_keep_small_angles(decade: float) -> None:
    phi = 10.0**decade * np.array([0.6, -0.64, 0.48])
    np.testing.assert_allclose(rotation.log(rotation.exp(phi)), phi, rtol=1e-9)


@given(arrays(np.float64, (5, 4), elements=components).map(lambda x: np.array([_unit(q) for q in x])))
def test_the_vertical_in_a_body_is_that_of_a_rotation(q: Floats) -> None:
    turned = rotation.rotate(rotation.conjugate(q), np.array([0.0, 0.0, 1.0]))
    assert rotation.find_vertical(q).tobytes() == turned.tobytes()


@given(quaternions, quaternions)
def test_the_middle_is_half_way_along_the_shorter_arc(p: Floats, q: Floats) -> None:
    half = rotation.find_middle(p[None], q[None])[0]
    whole = float(rotation.angle_between(p, q))
    assert abs(float(rotation.angle_between(p, half)) - whole / 2) < 1e-7
    assert abs(float(rotation.angle_between(half, q)) - whole / 2) < 1e-7


@pytest.mark.slow
@given(quaternions, arrays(np.float64, (6, 3), elements=st.floats(-0.2, 0.2, width=64)), quaternions)
def test_mean_moves_with_its_members(q: Floats, spread: Floats, shift: Floats) -> None:
    members = rotation.multiply(q, rotation.exp(spread))
    moved = rotation.mean(rotation.multiply(shift, members))
    assert same_rotation(moved, rotation.multiply(shift, rotation.mean(members)), 1e-7)


@given(st.floats(-3.0, 3.0), st.integers(0, 2))
def test_about_turns_about_one_axis(angle: float, axis: int) -> None:
    expected = np.zeros(3)
    expected[axis] = angle
    np.testing.assert_allclose(rotation.log(rotation.about(axis, angle)), expected, atol=1e-12)


@given(st.floats(-3.0, 3.0), st.floats(-1.2, 1.2))
def test_yaw_reads_the_heading_of_x(heading: float, pitch: float) -> None:
    q = rotation.multiply(rotation.about(2, heading), rotation.about(1, pitch))
    assert abs(float(rotation.yaw(q)) - heading) < 1e-9


@given(st.floats(-50.0, 50.0))
def test_a_wrapped_angle_is_the_same_direction(angle: float) -> None:
    wrapped = rotation.wrap_angle(angle)
    assert -np.pi <= wrapped < np.pi
    assert abs(np.exp(1j * wrapped) - np.exp(1j * angle)) < 1e-13
    assert compiled.wrap_angle(angle) == wrapped
    assert rotation.wrap_angle(np.array([angle]))[0] == wrapped


@pytest.mark.slow
@given(quaternions, quaternions, vectors)
def test_compiled_loops_turn_as_arrays_do(p: Floats, q: Floats, phi: Floats) -> None:
    matrix, product, back = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    compiled.to_matrix(p, matrix)
    np.testing.assert_allclose(matrix, rotation.to_matrix(p), atol=1e-14)
    quaternion = np.empty(4)
    compiled.from_matrix(matrix, quaternion)
    assert same_rotation(quaternion, p)
    assert quaternion[0] >= 0.0
    compiled.transform(matrix, phi, back)
    np.testing.assert_allclose(back, rotation.rotate(p, phi), atol=1e-13)
    np.testing.assert_allclose(compiled.multiply(*p, *q), rotation.multiply(p, q), atol=1e-15)
    turned = p.copy()
    compiled.turn(turned, *phi)
    np.testing.assert_allclose(turned, rotation.multiply(p, rotation.exp(phi)), atol=1e-12)
    compiled.multiply3(matrix, rotation.to_matrix(q), product)
    np.testing.assert_allclose(product, matrix @ rotation.to_matrix(q), atol=1e-14)
    compiled.exp_so3(phi, matrix, product)
    np.testing.assert_allclose(matrix, rotation.to_matrix(rotation.exp(phi)), atol=1e-12)
    compiled.log_so3(matrix, back)
    np.testing.assert_allclose(rotation.to_matrix(rotation.exp(back)), matrix, atol=1e-7)


@given(vectors, vectors)
def test_compiled_cross_products_are_those_of_numpy(a: Floats, b: Floats) -> None:
    cross, both = np.empty((3, 3)), np.empty((3, 3))
    compiled.skew(a, cross)
    product = np.empty(3)
    compiled.cross(a, b, product)
    np.testing.assert_allclose(product, np.cross(a, b), atol=1e-12)
    np.testing.assert_allclose(cross @ b, np.cross(a, b), atol=1e-12)
    compiled.times_cross(np.eye(3), a, -2.0, both)
    np.testing.assert_allclose(both, -2.0 * cross)
    compiled.skew_polynomial(a, 3.0, 2.0, 0.5, both)
    np.testing.assert_allclose(both, 3.0 * np.eye(3) + 2.0 * cross + 0.5 * cross @ cross, atol=1e-11)


@given(arrays(np.float64, 3, elements=st.floats(-0.5, 0.5, width=64)))
def test_a_rotation_with_rounding_becomes_a_rotation_again(phi: Floats) -> None:
    R, work = rotation.to_matrix(rotation.exp(phi)) + 1e-7 * np.arange(9.0).reshape(3, 3), np.empty((2, 3, 3))
    compiled.orthonormalise(R, work)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-11)


@pytest.mark.parametrize("rows", [16_384, 16_385, 40_000])
def test_long_arrays_are_worked_out_as_short_ones_are(rows: int) -> None:
    rng = np.random.default_rng(1)
    p, q = (rotation.normalise(rng.normal(size=(rows, 4))) for _ in range(2))
    v = rng.normal(size=(rows, 3))

    def pieces(of: Callable[..., Floats], *by: Floats) -> Floats:
        cut = range(0, rows, 1000)
        return np.concatenate([of(*(x[i : i + 1000] if x.ndim == 2 else x for x in by)) for i in cut])

    for of, by in (
        (rotation.multiply, (p, q)),
        (rotation.multiply, (p, q[0])),
        (rotation.multiply, (p[0], q)),
        (rotation.rotate, (p, v)),
        (rotation.rotate, (p, v[0])),
        (rotation.rotate, (p[0], v)),
    ):
        np.testing.assert_array_equal(of(*by), pieces(of, *by))
    np.testing.assert_array_equal(rotation.multiply(p[:1], q), rotation.multiply(p[0], q))
