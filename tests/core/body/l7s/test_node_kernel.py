"""A pass of Gauss–Newton over the nodes, against the same least squares with one matrix."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body.l7s import node_kernel
from sagittal.core.body.l7s.node_kernel import KEPT, SIZE
from sagittal.core.frames import Bools, Floats
from sagittal.core.rotation import exp, to_matrix
from tests.helpers.uncompiled import run_uncompiled

T = 5
HEIGHTS = np.array([0.9, 0.05])
LENGTHS = np.array([0.09, 0.1, 0.86, 0.85])
"""Half hip width, half foot, leg, leg that carries, m."""
HOLD = np.array([0.5, 30.0, 2.0, 3.0, 4.0, 50.0])


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    run_uncompiled(monkeypatch, node_kernel)


def nodes(seed: int = 1) -> tuple[Floats, Floats, Floats, Floats, Floats, Bools]:
    """Places, the filter's, orientations, bends, stiffness, and who rests: a person who takes a step."""
    rng = np.random.default_rng(seed)
    standing = np.array([0.0, 0.0, 0.9, 0.05, 0.09, 0.05, 0.05, -0.09, 0.05])
    x = standing + rng.normal(0.0, 0.02, (T, SIZE))
    R = to_matrix(exp(rng.normal(0.0, 0.1, (T, 3, 3))))
    stiff = np.zeros((T + 1, 3))
    stiff[1:-2] = 1.0 + rng.random((T - 2, 3))
    still = np.array([[True, True], [True, False], [True, False], [False, True], [False, True]])
    return x, standing + rng.normal(0.0, 0.02, (T, SIZE)), R, rng.normal(0.0, 0.01, (T, SIZE)), stiff, still


def solve_densely(
    x: Floats, start: Floats, R: Floats, bent: Floats, stiff: Floats, still: Bools, spread: Floats
) -> Floats:
    """Moves (T, 9) by all rows at once: weight, derivative, residual."""
    rows: list[tuple[float, Floats, float]] = []

    def add(weight: float, terms: dict[tuple[int, int], float], residual: float) -> None:
        row = np.zeros((T, SIZE))
        for index, value in terms.items():
            row[index] += value
        rows.append((weight, row.reshape(-1), residual))

    for k in range(T):
        for j in range(SIZE):
            if 0 < k < T - 1:
                bend = x[k - 1, j] - 2.0 * x[k, j] + x[k + 1, j] - bent[k, j]
                add(stiff[k, j // 3], {(k - 1, j): 1.0, (k, j): -2.0, (k + 1, j): 1.0}, bend)
            add(HOLD[0], {(k, j): 1.0}, x[k, j] - start[k, j])
            if j >= 3 and k < T - 1 and still[k, j // 3 - 1]:
                add(HOLD[1], {(k, j): -1.0, (k + 1, j): 1.0}, x[k + 1, j] - x[k, j])
        for i in range(2):
            add(HOLD[2], {(k, i): 1.0, (k, 3 + i): -0.5, (k, 6 + i): -0.5},
                x[k, i] - 0.5 * (x[k, 3 + i] + x[k, 6 + i]))  # fmt: skip
        add(HOLD[3], {(k, 2): 1.0}, x[k, 2] - HEIGHTS[0])
        for leg in range(2):
            f = 3 + 3 * leg
            add(HOLD[5] if still[k, leg] else HOLD[4], {(k, f + 2): 1.0}, x[k, f + 2] - HEIGHTS[1])
            hip = x[k, :3] + (1.0 - 2.0 * leg) * LENGTHS[0] * R[k, 0, :, 1]
            apart = hip - (x[k, f : f + 3] - LENGTHS[1] * R[k, 1 + leg, :, 2])
            reach = float(np.linalg.norm(apart))

            def along(weight: float, direction: Floats, residual: float, f: int = f, k: int = k) -> None:
                terms = {(k, i): direction[i] for i in range(3)} | {
                    (k, f + i): -direction[i] for i in range(3)
                }
                add(weight, terms, residual)

            hinge = R[k, 1 + leg, :, 1]
            along(spread[0], hinge, float(hinge @ apart))
            if still[k, leg] and not still[k, 1 - leg]:
                along(spread[1], apart / reach, reach - LENGTHS[3])
            if reach > LENGTHS[2]:
                along(spread[2], apart / reach, reach - LENGTHS[2])
    weight, J, residual = (np.array(x) for x in zip(*rows, strict=True))
    return np.linalg.solve(J.T @ (weight[:, None] * J), -J.T @ (weight * residual)).reshape(T, SIZE)


@pytest.mark.parametrize("spread", [(0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (0.0, 40.0, 0.0), (20.0, 40.0, 60.0)])
def test_one_pass_moves_the_nodes_by_the_least_squares(spread: tuple[float, ...]) -> None:
    x, start, R, bent, stiff, still = nodes()
    weights = np.array(spread)
    moves = solve_densely(x, start, R, bent, stiff, still, weights)
    moved = x.copy()
    most = node_kernel.move_nodes(
        moved, start, R, bent, stiff, still, HOLD, weights, LENGTHS, HEIGHTS, np.empty((T, KEPT))
    )
    np.testing.assert_allclose(moved - x, moves, atol=1e-9)
    assert most == pytest.approx(np.abs(moves).max())


def test_places_that_nothing_holds_cannot_be_found() -> None:
    x, start, R, bent, stiff, still = nodes()
    most = node_kernel.move_nodes(
        x, start, R, bent, np.zeros_like(stiff), still, np.zeros(6), np.zeros(3), LENGTHS, HEIGHTS,
        np.empty((T, KEPT)),
    )  # fmt: skip
    assert np.isnan(most)


def test_a_sweep_leaves_the_negative_inverse_below_the_diagonal() -> None:
    rng = np.random.default_rng(2)
    B = rng.normal(0.0, 1.0, (SIZE, SIZE))
    A = B @ B.T + np.eye(SIZE)
    swept = np.tril(A).reshape(-1)
    assert node_kernel._sweep(swept, np.empty(SIZE))
    tril = np.tril(swept.reshape(SIZE, SIZE))
    assert tril == pytest.approx(np.tril(-np.linalg.inv(A)))
    assert not node_kernel._sweep((A - 20.0 * np.eye(SIZE)).reshape(-1).copy(), np.empty(SIZE))
