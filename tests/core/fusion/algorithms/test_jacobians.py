"""Every derivative of the compiled engines against differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms import direction, error_state, extended_kalman, quaternion_kalman
from sagittal.core.rotation import conjugate, exp, multiply, normalise, rotate

pytestmark = pytest.mark.slow

RNG = np.random.default_rng(3)
UP = np.array([0.0, 0.0, 1.0])
FIELD = np.array([0.0, 0.45, -np.sqrt(1.0 - 0.45**2)])


def differences(f: Callable[[Floats], Floats], x: Floats, step: float = 1e-6) -> Floats:
    """Derivative of f at x by central differences."""
    columns = [(f(x + d) - f(x - d)) / (2.0 * step) for d in step * np.eye(len(x))]
    return np.array(columns).T


def test_the_prediction_of_the_extended_filters() -> None:
    q, w, b, dt = (
        normalise(RNG.standard_normal(4)),
        np.array([2.0, -1.0, 3.0]),
        np.array([0.1, -0.2, 0.05]),
        0.01,
    )

    def turned(x: Floats) -> Floats:
        return multiply(x[:4], exp((w - x[4:]) * dt))

    n = 7
    x, P = np.concatenate((q, b)), 1e-3 * np.eye(n)
    turn, B = np.empty((4, 4)), np.empty((4, 3))
    extended_kalman.predict_state(
        x, P, w.copy(), dt, 0.0, 4, np.ones(n), np.zeros(n), turn, B, np.empty((4, 3)), np.empty((4, n))
    )
    result = differences(turned, np.concatenate((q, b)))
    assert np.abs(x[:4] - turned(np.concatenate((q, b)))).max() < 1e-15
    assert np.abs(turn - result[:, :4]).max() < 1e-9
    # eq 40 is the first two terms of a series in ωT
    assert np.abs(B - result[:, 4:]).max() < 3e-6
    F = np.eye(n)
    F[:4, :4], F[:4, 4:] = turn, B
    assert np.abs(P - 1e-3 * F @ F.T).max() < 1e-15


@pytest.mark.sweep
@pytest.mark.parametrize("kind", ["gd_plain", "linear", "algebraic", "gd_disturbed"])
def test_the_derivative_of_a_measured_quaternion(kind: str) -> None:
    """By both sensors."""
    number = quaternion_kalman.KINDS.index(kind)
    n = quaternion_kalman.count_states(kind)
    q = normalise(RNG.standard_normal(4))
    x = np.concatenate((q, 0.05 * RNG.standard_normal(n - 4)))

    def make(am: Floats) -> tuple[Floats, Floats]:
        y, J = np.empty(n), np.zeros((n, 6))
        xi, work, four = np.empty((4, 3)), np.empty((4, 3)), np.empty((2, 4))
        a, m = am[:3].copy(), am[3:].copy()
        assert quaternion_kalman._make(number, x, a, m, FIELD, 0.2, y, J, xi, work, four)
        return y, J

    near = multiply(q, exp(np.array([0.03, -0.02, 0.04])))
    am = np.concatenate((rotate(conjugate(near), UP), rotate(conjugate(near), FIELD)))
    J = make(am)[1]
    # lengths are not part of these measurements
    lateral = np.eye(6)
    if kind != "gd_disturbed":
        lateral[:3, :3] -= np.outer(am[:3], am[:3])
        lateral[3:, 3:] -= np.outer(am[3:], am[3:])
    result = differences(lambda v: make(v)[0], am)
    assert np.abs((result - J) @ lateral).max() < 1e-8


@pytest.mark.parametrize("kind", ["wahba", "gd_recursive"])
def test_the_derivative_of_a_measured_quaternion_at_a_fixed_dip(kind: str) -> None:
    """These take the dip from the sample too; their papers leave that out of the derivative."""
    q, mu = normalise(RNG.standard_normal(4)), 0.2
    near = multiply(q, exp(np.array([0.03, -0.02, 0.04])))
    am = np.concatenate((rotate(conjugate(near), UP), rotate(conjugate(near), FIELD)))
    y, J = np.empty(4), np.zeros((4, 6))
    number = quaternion_kalman.KINDS.index(kind)
    xi, work, four = np.empty((4, 3)), np.empty((4, 3)), np.empty((2, 4))
    assert quaternion_kalman._make(number, q, am[:3], am[3:], FIELD, mu, y, J, xi, work, four)

    def apply(r: Floats, b: Floats, x: Floats) -> Floats:
        return -multiply(multiply(np.array([0.0, *r]), x), np.array([0.0, *b]))

    def make(v: Floats) -> Floats:
        field = apply(FIELD, v[3:], q)
        if kind == "gd_recursive":
            return 2.0 * mu * (apply(UP, v[:3], q) + field - 2.0 * q)
        pair = field + q
        return 0.25 * (apply(UP, v[:3], pair) + pair) - q

    assert np.abs(make(am) - y).max() < 1e-12
    assert np.abs(differences(make, am) - J).max() < 1e-9


def test_the_measurement_is_the_state_where_sensors_agree_with_it() -> None:
    q = normalise(RNG.standard_normal(4))
    a, m = rotate(conjugate(q), UP), rotate(conjugate(q), FIELD)
    for number, kind in enumerate(quaternion_kalman.KINDS):
        if kind == "pseudo":
            continue
        n = quaternion_kalman.count_states(kind)
        y = np.empty(n)
        quaternion_kalman._make(
            number, np.concatenate((q, np.zeros(n - 4))), a, m, FIELD, 0.2, y, np.zeros((n, 6)),
            np.empty((4, 3)), np.empty((4, 3)), np.empty((2, 4)),
        )  # fmt: skip
        assert np.abs(y).max() < 1e-12, kind


def test_rows_of_an_error_in_sensor_axes() -> None:
    q = normalise(RNG.standard_normal(4))
    v = rotate(conjugate(q), FIELD)
    result = differences(lambda e: rotate(conjugate(multiply(q, exp(e))), FIELD), np.zeros(3))
    for i in range(3):
        h = np.empty(6)
        error_state._point_row(h, v, i)
        assert np.abs(h[:3] - result[i]).max() < 1e-9


def test_principal_axes_are_those_of_numpy() -> None:
    A = RNG.standard_normal((3, 3))
    A = A @ A.T
    diagonal, axes = A.copy(), np.empty((3, 3))
    error_state.principal_axes(diagonal, axes)
    assert np.abs(axes @ np.diag(np.diag(diagonal)) @ axes.T - A).max() < 1e-12
    assert np.abs(np.sort(np.diag(diagonal)) - np.linalg.eigvalsh(A)).max() < 1e-12


def test_the_vertical_moves_with_the_bias_as_its_covariance_says() -> None:
    g, w, dt = normalise(RNG.standard_normal(3)), np.array([1.0, -2.0, 0.5]), 1e-3
    E = np.empty((3, 3))
    direction._turn_back(w * dt, E)
    result = differences(lambda b: rotate(conjugate(exp((w - b) * dt)), g), np.zeros(3))
    x, P = np.concatenate((g, np.zeros(3))), np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    direction._advance_vertical(x, P, E, np.empty((3, 6)), dt, 0.0, 0.0)
    assert np.abs(x[:3] - E @ g).max() < 1e-15
    assert np.abs(P[:3, 3:] - result).max() < 2.0 * dt**2
