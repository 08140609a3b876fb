"""The step of L7S as it is written: prediction against whole matrices, rows against differences."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body.l7s import kernel, updates
from sagittal.core.body.l7s.updates import VELOCITY, WIDTH, N
from sagittal.core.frames import Floats
from sagittal.core.rotation import exp, to_matrix
from tests.helpers.uncompiled import run_uncompiled

DT = 0.01
Q_ACC, Q_TURN = 100.0, 1000.0
HEIGHTS = np.array([0.9, 0.05])
VARIANCES = np.array([10.0, 1.0, 2.0, 0.1, 0.01])
"""Orientation, mid-pelvis, height of the pelvis, yaw, zero velocity."""


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    run_uncompiled(monkeypatch, kernel)


def skew(a: Floats) -> Floats:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def state(seed: int = 3) -> tuple[Floats, Floats, Floats]:
    """R, p, v of a person who stands about so."""
    rng = np.random.default_rng(seed)
    R = to_matrix(exp(rng.normal(0.0, 0.4, (3, 3))))
    p = np.array([[0.0, 0.0, 0.9], [0.1, 0.09, 0.05], [0.0, -0.09, 0.06]])
    return R, p + rng.normal(0.0, 0.02, (3, 3)), rng.normal(0.0, 1.0, (3, 3))


def spread(seed: int = 4) -> Floats:
    """A covariance (27, 27)."""
    A = np.random.default_rng(seed).normal(0.0, 0.3, (N, N))
    return np.asarray(A @ A.T + np.eye(N))


def widen(P: Floats) -> Floats:
    wide = np.zeros((WIDTH, WIDTH))
    wide[:N, :N] = P
    return wide.reshape(-1)


@pytest.mark.parametrize("printed", [True, False])
def test_the_prediction_is_that_of_the_paper(printed: bool) -> None:
    R, p, v = state()
    acc, P = np.random.default_rng(5).normal(0.0, 3.0, (3, 3)), spread()
    F, noise = np.eye(N), np.zeros((N, N))
    for b in range(3):
        rho, phi, nu = (slice(k, k + 3) for k in (6 * b, 6 * b + 3, VELOCITY + 3 * b))
        omega = R[b].T @ (DT * v[b] + 0.5 * DT**2 * acc[b])
        F[rho, nu] = DT * R[b].T
        if printed:
            F[rho, phi] = skew(omega)
        G = np.zeros((N, 6))
        G[rho, :3], G[nu, :3] = 0.5 * DT**2 * R[b].T, DT * np.eye(3)
        G[phi, 3:] = np.eye(3)
        turned = np.eye(N)
        turned[rho, phi] = -0.5 * skew(omega)
        noise += turned @ G @ np.diag([Q_ACC] * 3 + [Q_TURN] * 3) @ G.T @ turned.T
    expected_p, expected_v = p + DT * v + 0.5 * DT**2 * acc, v + DT * acc
    wide = widen(P)
    kernel.predict(
        R, p, v, wide, acc, DT, Q_ACC, Q_TURN, printed, np.empty((3, 3)), np.empty((3, 3, 6)), WIDTH
    )
    assert p == pytest.approx(expected_p)
    assert v == pytest.approx(expected_v)
    result = wide.reshape(WIDTH, WIDTH)
    np.testing.assert_allclose(result[:N, :N], F @ P @ F.T + noise, atol=1e-9)
    assert not result[N].any()
    assert not result[:, N].any()


def rows_of(
    group: int, R: Floats, p: Floats, v: Floats, measured: Floats
) -> tuple[Floats, Floats, Floats, list[int]]:
    """H (3, 27), residuals and variances of a group, and the places it reads."""
    index, H, left, variance, gain = updates.make_form()
    values = np.array([0.3, 0.4])
    triples = kernel._write_rows(
        group,
        R,
        p,
        v,
        measured,
        values,
        HEIGHTS,
        VARIANCES,
        (index, H, left, variance, gain),
        np.empty((3, 3)),
    )
    whole = np.zeros((3, N))
    for t in range(triples):
        whole[:, index[t] : index[t] + 3] += H[:, 3 * t : 3 * t + 3]
    return whole, left, variance, index[:triples].tolist()


def move(R: Floats, p: Floats, v: Floats, e: Floats) -> tuple[Floats, Floats, Floats]:
    """X Exp(ε) for a small ε."""
    R, p, v = R.copy(), p.copy(), v.copy()
    for b in range(3):
        rho, phi = e[6 * b : 6 * b + 3], e[6 * b + 3 : 6 * b + 6]
        p[b] += R[b] @ rho
        R[b] = R[b] @ to_matrix(exp(phi))
        v[b] += e[VELOCITY + 3 * b : VELOCITY + 3 * b + 3]
    return R, p, v


@pytest.mark.parametrize(
    ("group", "places", "spreads"),
    [
        (0, [3], [10.0] * 3),
        (1, [9], [10.0] * 3),
        (2, [15], [10.0] * 3),
        (3, [21], [0.01] * 3),
        (4, [24], [0.01] * 3),
        (5, [0, 6, 12], [1.0, 1.0, 2.0]),
        (6, [6, 12], [0.3, 0.4]),
    ],
)
def test_residuals_shrink_along_their_own_rows(group: int, places: list[int], spreads: list[float]) -> None:
    R, p, v = state()
    measured = R.copy()
    H, left, variance, position = rows_of(group, R, p, v, measured)
    rows = len(spreads)
    assert position == places
    assert variance[:rows] == pytest.approx(spreads)
    step = 1e-6
    for i in range(N):
        e = np.zeros(N)
        e[i] = step
        final = rows_of(group, *move(R, p, v, e), measured)[1]
        slope = (left[:rows] - final[:rows]) / step
        assert slope == pytest.approx(H[:rows, i], abs=1e-4), i


def test_the_pelvis_without_a_sensor_faces_as_the_feet_do_and_stays_level() -> None:
    R, p, v = state()
    feet = R[1, :2, 2] + R[2, :2, 2]
    theta = float(np.arctan2(feet[1], feet[0]))
    R[0] = to_matrix(exp(np.array([0.0, 0.0, theta])))
    H, left, variance, position = rows_of(7, R, p, v, R)
    assert left == pytest.approx(0.0, abs=1e-9)
    assert position == [3, 9, 15]
    assert variance == pytest.approx(0.1)
    R[0] = to_matrix(exp(np.array([0.0, 0.0, theta - 0.2])))
    assert rows_of(7, R, p, v, R)[1] == pytest.approx([0.0, 0.0, 0.2])
    assert np.abs(H[:2, 9:12]).max() < 1e-9, "feet turn its heading alone"


@pytest.mark.parametrize(("three", "stands"), [(True, (True, False)), (False, (False, False))])
def test_only_feet_that_stand_are_held_and_only_a_worn_pelvis_is_measured(
    three: bool, stands: tuple[bool, bool]
) -> None:
    R, p, v = state()
    slow, wide, dx = v.copy(), widen(spread()), np.empty(WIDTH)
    kernel.apply_measurement(
        R, p, slow, wide, R.copy(), three, np.array(stands), np.array([1.0, 1.0]), HEIGHTS, VARIANCES, dx,
        updates.make_form(), np.empty((3, 3, 3)),
    )  # fmt: skip
    held = np.linalg.norm(slow[1:], axis=1) < 0.3 * np.linalg.norm(v[1:], axis=1)
    assert held.tolist() == list(stands)
    assert dx[N] == 0.0
    assert np.linalg.eigvalsh(wide.reshape(WIDTH, WIDTH)[:N, :N]).min() > 0.0
