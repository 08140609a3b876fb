"""The way back over a recorded segment, against the same with whole matrices."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body.erkf import sweep
from sagittal.core.body.erkf.kernel import SmootherRecord
from sagittal.core.body.erkf.predict import GAMMA, A, C, D, S
from sagittal.core.frames import Floats
from sagittal.core.rotation import exp, multiply
from tests.helpers.uncompiled import run_uncompiled

K, N, DT = 3, 2, 0.02
"""Samples, IMUs, s."""


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    run_uncompiled(monkeypatch, sweep)


def record(m: int) -> SmootherRecord:
    rng = np.random.default_rng(9)
    size = N * m
    return SmootherRecord(
        rng.normal(0.0, 0.3, (K, N, 5, 3, 3)), np.empty((K, 0, 3, size)), np.empty((K, 0, 9)),
        np.empty((K, 0, 2, 3, 3)), np.empty((K, 0, 4), np.int64), np.zeros(K, np.int64),
        rng.random((K, size)), rng.normal(0.0, 0.1, (K, size)),
    )  # fmt: skip


def transition(F: Floats, m: int) -> Floats:
    """F (n, 5, 3, 3) as one matrix."""
    whole = np.zeros((len(F) * m, len(F) * m))
    for i, own in enumerate(F):
        f = np.eye(m)
        f[3:6, 6:9], f[6:9, 6:9] = own[A], own[S]
        f[0:3, 3:6] = DT * np.eye(3)
        f[0:3, 6:9] = 0.5 * DT * own[A]
        if m == 15:
            f[3:6, 9:12], f[3:6, 12:15], f[6:9, 9:12] = own[D], own[C], own[GAMMA]
            f[0:3, 9:12], f[0:3, 12:15] = 0.5 * DT * own[D], 0.5 * DT * own[C]
        whole[i * m : (i + 1) * m, i * m : (i + 1) * m] = f
    return whole


@pytest.mark.parametrize("m", [9, 15])
def test_the_adjoint_goes_back_by_the_transposed_steps(m: int) -> None:
    retained, lam = record(m), np.random.default_rng(2).normal(0.0, 1.0, N * m)
    expected, swept = lam.copy(), np.empty((K, N * m))
    sweep.sweep_back(lam, np.full(K, DT), retained, m, swept)
    for k in range(K - 1, -1, -1):
        assert swept[k] == pytest.approx(expected)
        expected = transition(retained.F[k], m).T @ expected
    assert lam == pytest.approx(expected)


def test_only_the_lower_half_of_the_covariance_is_read() -> None:
    rng = np.random.default_rng(3)
    B = rng.normal(0.0, 1.0, (5, 5))
    P, lam, d = B @ B.T, rng.normal(0.0, 1.0, 5), np.full(5, 7.0)
    sweep.multiply_lower(np.tril(P) + np.triu(np.full((5, 5), 99.0), 1), lam, d)
    assert d == pytest.approx(-P @ lam)


@pytest.mark.parametrize("m", [9, 15])
def test_smoothed_states_are_the_filtered_ones_moved_by_what_came_later(m: int) -> None:
    retained = record(m)
    rng = np.random.default_rng(5)
    swept, d = rng.normal(0.0, 0.1, (K, N * m)), rng.normal(0.0, 0.1, N * m)
    states = rng.normal(0.0, 1.0, (K, N, 16))
    states[..., 6:10] /= np.linalg.norm(states[..., 6:10], axis=-1, keepdims=True)
    duplicate, expected = states.copy(), d.copy()
    sweep.move_smoothed(d, np.full(K, DT), retained, m, swept, duplicate)
    for k in range(K):
        expected = transition(retained.F[k], m) @ expected - retained.Q[k] * swept[k] - retained.dx[k]
        for i in range(N):
            own, a = expected[i * m : (i + 1) * m], 0.5 * retained.dx[k][i * m + 6 : i * m + 9]
            assert duplicate[k, i, :6] - states[k, i, :6] == pytest.approx(own[:6])
            turn = own[6:9] - np.cross(a, own[6:9])
            assert duplicate[k, i, 6:10] == pytest.approx(multiply(states[k, i, 6:10], exp(turn)))
            biases = duplicate[k, i, 10:] - states[k, i, 10:]
            assert biases == pytest.approx(own[9:] if m == 15 else np.zeros(6))


def test_a_row_is_copied_and_the_rest_stays() -> None:
    target = np.zeros((2, 3))
    sweep.copy_row(np.array([1.0, 2.0, 3.0]), target[1])
    assert target.tolist() == [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]
