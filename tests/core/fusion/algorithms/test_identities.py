"""Identities that reduce 37 algorithms to six engines, and steps of the Kalman filters."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms import kalman, sigma_point, vectors
from sagittal.core.rotation import conjugate, exp, multiply, normalise, rotate, to_matrix

RNG = np.random.default_rng(11)
UP = np.array([0.0, 0.0, 1.0])


def unit(n: int = 3) -> Floats:
    return normalise(RNG.standard_normal(n))


def left(r: Floats) -> Floats:
    """Matrix (4, 4) of r ⊗ q of a pure r (3,)."""
    return np.array([multiply(np.array([0.0, *r]), e) for e in np.eye(4)]).T


def right(b: Floats) -> Floats:
    return np.array([multiply(e, np.array([0.0, *b])) for e in np.eye(4)]).T


def observing(r: Floats, b: Floats) -> Floats:
    """W(r, b) (4, 4), column by column of `observe`."""
    columns = []
    for e in np.eye(4):
        out = np.empty(4)
        vectors.observe(r, b, e, out)
        columns.append(out)
    return np.array(columns).T


def test_w_is_symmetric_with_eigenvalues_of_one_and_keeps_q_where_b_is_r_in_the_sensor() -> None:
    q, r = unit(4), unit()
    b = rotate(conjugate(q), r)
    result = observing(r, b)
    assert np.abs(result + left(r) @ right(b)).max() < 1e-15
    assert np.abs(result - result.T).max() < 1e-12
    assert np.abs(np.abs(np.linalg.eigvalsh(result)) - 1.0).max() < 1e-12
    assert np.abs(result @ q - q).max() < 1e-12
    assert np.abs(observing(r, unit()) @ q - q).max() > 1e-3


def test_choukrouns_pseudo_measurement_is_zero_at_q() -> None:
    q, r = unit(4), unit()
    H = 0.5 * (right(rotate(conjugate(q), r)) - left(r))
    assert np.abs(H @ q).max() < 1e-12


def test_guos_measurement_is_q_itself_at_q() -> None:
    q, m = unit(4), unit()
    a, f = rotate(conjugate(q), UP), rotate(conjugate(q), m)
    one = np.eye(4)
    assert np.abs(0.25 * (observing(UP, a) + one) @ (observing(m, f) + one) @ q - q).max() < 1e-12


@pytest.mark.slow
def test_wus_step_is_the_gradients_step_on_the_tangent() -> None:
    q, r, a = unit(4), unit(), unit()
    J, f = np.empty((3, 4)), np.empty(3)
    vectors.to_sensor(q, r, f)
    vectors.direction_jacobian(q, r, J)
    tangent = np.eye(4) - np.outer(q, q)
    gradient = tangent @ J.T @ (f - a)
    assert np.abs(tangent @ (2.0 * (observing(r, a) - np.eye(4)) @ q) + gradient).max() < 1e-12


def test_a_step_against_the_gradient_is_the_transposed_jacobian() -> None:
    q, r, d, J = unit(4), unit(), RNG.standard_normal(3), np.empty((3, 4))
    vectors.direction_jacobian(q, r, J)
    assert np.abs(np.array(vectors.climb_direction(q, *r, *d)) - J.T @ d).max() < 1e-14


def test_to_sensor_and_to_world_are_the_matrix_and_its_transpose() -> None:
    q, v, out = unit(4), RNG.standard_normal(3), np.empty(3)
    vectors.to_sensor(q, v, out)
    assert np.abs(out - to_matrix(q).T @ v).max() < 1e-14
    vectors.to_world(q, v, out)
    assert np.abs(out - to_matrix(q) @ v).max() < 1e-14


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 0.19, 0.21, 3.0])
def test_the_turn_of_a_sample_is_the_exponential(angle: float) -> None:
    phi = angle * unit()
    assert np.abs(np.array(vectors.half_turn(*phi)) - exp(phi)).max() < 1e-13


def test_derivatives_of_a_direction_agree_with_differences() -> None:
    q, r, J = unit(4), unit(), np.empty((3, 4))
    vectors.direction_jacobian(q, r, J)
    step = 1e-6
    for j in range(4):
        ends = []
        for sign in (1.0, -1.0):
            moved, out = q.copy(), np.empty(3)
            moved[j] += sign * step
            vectors.to_sensor(moved, r, out)
            ends.append(out)
        assert np.abs((ends[0] - ends[1]) / (2.0 * step) - J[:, j]).max() < 1e-9


def test_the_derivative_by_the_rate_stands_across_q() -> None:
    q, xi = unit(4), np.empty((4, 3))
    vectors.rate_jacobian(q, xi)
    assert np.abs(xi.T @ q).max() < 1e-15
    w = RNG.standard_normal(3)
    assert np.abs(xi @ w - multiply(q, np.array([0.0, *w]))).max() < 1e-15


def test_triad_stands_upright_and_faces_north() -> None:
    q, R = unit(4), np.empty((3, 3))
    north = np.array([0.0, 0.4, -0.9])
    assert vectors.level(rotate(conjugate(q), 9.8 * UP), rotate(conjugate(q), north), R)
    assert np.abs(R - to_matrix(q)).max() < 1e-14
    assert not vectors.level(UP, 2.0 * UP, R)


def covariance(n: int) -> Floats:
    A = RNG.standard_normal((n, n))
    return A @ A.T / n + 0.1 * np.eye(n)


def test_rows_one_by_one_equal_the_textbooks_update() -> None:
    n, m = 10, 6
    P, H, y, variance = covariance(n), RNG.standard_normal((m, n)), RNG.standard_normal(m), 0.3
    S = H @ P @ H.T + variance * np.eye(m)
    K = P @ H.T @ np.linalg.inv(S)
    duplicate, dx, u = P.copy(), np.zeros(n), np.empty(n)
    for i in range(m):
        kalman.take_scalar(duplicate, H[i], variance, y[i], dx, u)
    assert np.abs(duplicate - (np.eye(n) - K @ H) @ P).max() < 1e-12
    assert np.abs(dx - K @ y).max() < 1e-12
    assert np.array_equal(duplicate, duplicate.T)


@pytest.mark.slow
def test_a_block_of_rows_equals_the_textbooks_update() -> None:
    n, m = 9, 3
    P, H, y, R = covariance(n), RNG.standard_normal((m, n)), RNG.standard_normal(m), covariance(m)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    duplicate, dx = P.copy(), np.zeros(n)
    assert kalman.take_block(
        duplicate, H, R, y.copy(), dx, np.empty((m, m)), np.empty((m, m)), np.empty((m, n))
    )
    assert np.abs(duplicate - (np.eye(n) - K @ H) @ P).max() < 1e-12
    assert np.abs(dx - K @ y).max() < 1e-12


@pytest.mark.slow
def test_the_bounded_covariance_is_that_of_the_thesis() -> None:
    """Eq 47 in both forms: with the stacked matrix, and by inverses."""
    n, m = 7, 3
    P, H, R, gamma = covariance(n), RNG.standard_normal((m, n)), covariance(m), 3.0
    stacked = np.vstack((H, np.eye(n)))
    middle = np.block([[R, np.zeros((m, n))], [np.zeros((n, m)), -(gamma**2) * np.eye(n)]])
    literal = P - P @ stacked.T @ np.linalg.inv(middle + stacked @ P @ stacked.T) @ stacked @ P
    inverse = np.linalg.inv(np.linalg.inv(P) + H.T @ np.linalg.inv(R) @ H - np.eye(n) / gamma**2)
    result = np.linalg.inv(np.linalg.inv(P) + H.T @ np.linalg.inv(R) @ H)
    work = [np.empty((n, n)) for _ in range(3)]
    assert kalman.bound_worst_case(result, gamma**2, *work)
    assert np.abs(result - literal).max() < 1e-12
    assert np.abs(result - inverse).max() < 1e-12


def test_a_bound_below_the_largest_eigenvalue_is_refused() -> None:
    P = covariance(5)
    stored_duplicate, largest = P.copy(), float(np.linalg.eigvalsh(P)[-1])
    work = [np.empty((5, 5)) for _ in range(3)]
    assert not kalman.bound_worst_case(P, 0.99 * largest, *work)
    assert np.array_equal(P, stored_duplicate)
    assert kalman.bound_worst_case(P, 1.01 * largest, *work)


@pytest.mark.slow
def test_triangularising_and_taking_away_keep_the_square() -> None:
    A, v = RNG.standard_normal((6, 15)), 0.3 * RNG.standard_normal(6)
    L = np.empty((6, 6))
    kalman.triangularise(A.copy(), L)
    assert np.abs(L @ L.T - A @ A.T).max() < 1e-12
    assert np.array_equal(L, np.tril(L))
    less = L.copy()
    assert kalman.take_away(less, v.copy())
    assert np.abs(less @ less.T - (A @ A.T - np.outer(v, v))).max() < 1e-12
    assert not kalman.take_away(L, 100.0 * v)
    factored = np.empty((6, 6))
    assert kalman.factor(A @ A.T, factored)
    assert np.abs(factored @ factored.T - A @ A.T).max() < 1e-12
    assert not kalman.factor(-np.eye(6), factored)


@pytest.mark.parametrize("n", [7, 10])
@pytest.mark.parametrize("kind", sigma_point.POINTS)
def test_sigma_points_have_mean_zero_and_covariance_one(kind: str, n: int) -> None:
    points, mean, spread = sigma_point.make_points(kind, n, alpha=0.7, beta=2.0, kappa=-2.0, weight=0.3)
    assert mean.sum() == pytest.approx(1.0, abs=1e-12)
    assert np.abs(mean @ points).max() < 1e-12
    # the first point of `merwe` stands in the mean, so its weight in the covariance is free
    assert np.abs(points.T @ (spread[:, None] * points) - np.eye(n)).max() < 1e-12


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("julier95", {"kappa": -10.0}),
        ("menegaz", {"weight": 1.0}),
        ("spherical_simplex", {"weight": 0.0}),
        ("x", {}),
    ],
)
def test_impossible_sigma_points_are_refused(kind: str, options: dict[str, float]) -> None:
    with pytest.raises(ParameterError):
        sigma_point.make_points(kind, 10, **options)
