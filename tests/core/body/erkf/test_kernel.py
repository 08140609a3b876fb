"""Parts of the ErKF loop, uncompiled: gate, noise, contacts, retained states."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.body.erkf import kernel
from sagittal.core.body.erkf.filter import noise_of
from sagittal.core.body.erkf.kernel import (
    CONTACT,
    INVALID,
    PATCHED,
    ErkfMemory,
    ErkfOutput,
    ErkfSamples,
    ErkfScratch,
    Links,
    Noise,
    row_length,
)
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.frames import Floats
from tests.helpers.uncompiled import run_uncompiled

N = 2
"""IMUs."""


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    run_uncompiled(monkeypatch, kernel)


def spread(rng: np.random.Generator, size: int) -> Floats:
    """A covariance."""
    A = rng.normal(0.0, 1.0, (size, size))
    return np.asarray(A @ A.T + np.eye(size))


def memory(states: int = 15, seed: int = 0) -> ErkfMemory:
    rng = np.random.default_rng(seed)
    P = spread(rng, N * states)
    return ErkfMemory(
        rng.normal(0.0, 1.0, (N, 16)), P, rng.normal(0.0, 1.0, (N, 6)), rng.normal(0.0, 1.0, len(P)),
        np.array([3, 0]),
    )  # fmt: skip


def samples(flags: tuple[int, int], rolling: Floats | None = None) -> ErkfSamples:
    rng = np.random.default_rng(7)
    return ErkfSamples(
        np.array([0.01]), rng.normal(0.0, 1.0, (1, N, 3)), rng.normal(0.0, 1.0, (1, N, 3)),
        np.array([flags], np.uint8), np.empty((0, N)), np.empty((0, N)) if rolling is None else rolling,
    )  # fmt: skip


def scratch() -> ErkfScratch:
    return ErkfScratch(
        np.zeros((N, 3, 3)), np.empty((3, 3, 3)), np.empty(3), np.empty((10, 3)), np.zeros(N, np.bool_),
        np.zeros(N), np.empty(0),
    )  # fmt: skip


def noise(**changed: float) -> Noise:
    return noise_of(ErkfParams.offline(), 100.0)._replace(**changed)  # type: ignore[arg-type]


def links() -> Links:
    none = np.empty((0, 2, 3))
    sd = np.array([[0.1, 0.01], [0.2, 0.02]])
    return Links(np.empty((0, 2), np.int64), none, none, np.empty(0, np.bool_), np.zeros((N, 3)), sd)


@pytest.mark.parametrize("b", [0, 15])
def test_the_gate_is_the_normalised_square_of_the_velocity(b: int) -> None:
    rng = np.random.default_rng(4)
    P, v, sd = spread(rng, 30), rng.normal(0.0, 1.0, 3), 0.3
    S = P[b + 3 : b + 6, b + 3 : b + 6] + sd**2 * np.eye(3)
    square = float(v @ np.linalg.solve(S, v))
    assert kernel.is_within_gate(P, b, v, sd, square * 1.001)
    assert not kernel.is_within_gate(P, b, v, sd, square * 0.999)
    lower = np.tril(P)
    assert kernel.is_within_gate(lower, b, v, sd, square * 1.001), "above the diagonal nothing is read"


def test_noise_follows_the_sample_and_what_it_lacks() -> None:
    available, data, p, dt = memory(), samples((0, 0)), noise(), 0.01
    initial_duplicate, P, Q = available.before.copy(), available.P.copy(), np.empty(30)
    kernel.add_noise(available, data, 0, links(), p, Q)
    jump = ((data.acc[0] - initial_duplicate[:, :3]) ** 2).sum(axis=1)
    for i, (sd_a, sd_w) in enumerate(links().sd):
        own = Q[15 * i : 15 * i + 15]
        assert own[:3] == pytest.approx(0.0)
        assert own[3:6] == pytest.approx((sd_a**2 + p.impact**2 * jump[i]) * dt**2)
        assert own[6:9] == pytest.approx(sd_w**2 * dt**2)
        assert own[9:12] == pytest.approx(p.gyr_walk**2 * dt)
        assert own[12:15] == pytest.approx(p.acc_walk**2 * dt)
    np.testing.assert_allclose(available.P, P + np.diag(Q))
    assert available.before == pytest.approx(np.concatenate((data.acc[0], data.gyr[0]), axis=1))


def test_a_lost_sample_is_doubted_wholly_and_a_patched_one_more() -> None:
    p, dt = noise(gap_acc=5.0, gap_gyr=6.0, patch_acc=3.0, patch_gyr=4.0, impact=0.0), 0.01
    Q = np.empty(30)
    kernel.add_noise(memory(), samples((INVALID | PATCHED, PATCHED)), 0, links(), p, Q)
    assert Q[[3, 6]] == pytest.approx([25.0 * dt**2, 36.0 * dt**2])
    assert Q[[18, 21]] == pytest.approx([(0.2**2 + 9.0) * dt**2, (0.02**2 + 16.0) * dt**2])


def judge(inputs: ErkfMemory, data: ErkfSamples, p: Noise) -> tuple[list[bool], list[bool], ErkfScratch]:
    room, refused = scratch(), np.zeros(N, np.bool_)
    kernel.judge_contacts(inputs, data, 0, p, room, np.zeros(len(inputs.P)), refused)
    return room.taken.tolist(), refused.tolist(), room


def test_only_a_foot_in_contact_is_held_still_and_what_is_too_fast_is_refused() -> None:
    available = memory()
    available.x[0, 3:6], available.x[1, 3:6] = 0.0, 1e3
    p = noise(gate=9.0, reaccept=10)
    assert judge(available, samples((CONTACT, CONTACT)), p)[:2] == ([True, False], [False, True])
    assert available.refused.tolist() == [0, 1]
    assert judge(available, samples((0, CONTACT)), p)[:2] == ([False, False], [False, True])
    assert available.refused.tolist() == [0, 2]
    assert judge(available, samples((0, 0)), p)[:2] == ([False, False], [False, False])
    assert available.refused.tolist() == [0, 0]
    assert judge(available, samples((CONTACT, CONTACT)), p._replace(gate=-1.0))[0] == [True, True]
    assert judge(available, samples((CONTACT, CONTACT)), p._replace(zero_velocity=-1.0))[0] == [False, False]


def test_after_long_refusal_it_is_taken_with_all_doubt() -> None:
    available = memory()
    available.x[0, 3:6], available.refused[0] = 100.0, 9
    P, Q = available.P.copy(), np.zeros(30)
    p, room, refused = noise(gate=9.0, reaccept=10, reaccept_m=2.0), scratch(), np.zeros(N, np.bool_)
    kernel.judge_contacts(available, samples((CONTACT, 0)), 0, p, room, Q, refused)
    assert (room.taken.tolist(), refused.tolist()) == ([True, False], [True, False])
    assert Q[:3] == pytest.approx(4.0)
    assert Q[3:6] == pytest.approx(3e4)
    assert not Q[6:].any()
    np.testing.assert_allclose(available.P, P + np.diag(Q))


def test_a_rolling_foot_is_believed_less() -> None:
    available = memory()
    p = noise(zero_velocity=0.3, roll_m=0.2, gate=-1.0)
    _, _, room = judge(available, samples((CONTACT, CONTACT), np.array([[2.0, 0.0]])), p)
    assert room.zero_velocity == pytest.approx([0.5, 0.3])


@pytest.mark.parametrize("states", [9, 15])
def test_a_correction_moves_state_and_orientation(states: int) -> None:
    available, room = memory(states), scratch()
    x = available.x.copy()
    available.x[:, 6:10] = [1.0, 0.0, 0.0, 0.0]
    available.dx[:] = 0.0
    available.dx[0:3], available.dx[3:6], available.dx[6:9] = 1.0, 2.0, (0.0, 0.0, 0.2)
    if states == 15:
        available.dx[9:12], available.dx[12:15] = 3.0, 4.0
    nominal, heading_sd = np.empty((N, 16)), np.empty(N)
    kernel.inject(available, noise(m=states), room, nominal, heading_sd)
    assert nominal == pytest.approx(available.x)
    assert nominal[0, :6] - x[0, :6] == pytest.approx([1.0] * 3 + [2.0] * 3)
    assert nominal[0, 10:] - x[0, 10:] == pytest.approx([3.0] * 3 + [4.0] * 3 if states == 15 else 0.0)
    assert nominal[0, 6:10] == pytest.approx([np.cos(0.1), 0.0, 0.0, np.sin(0.1)])
    assert nominal[1, :6] == pytest.approx(x[1, :6])
    # the vertical is z of both sensors
    index = [8, states + 8]
    assert heading_sd == pytest.approx(np.sqrt(available.P[index, index]))


def test_joints_are_as_far_apart_as_their_two_ends() -> None:
    room, residual = scratch(), np.empty(1)
    room.R[:] = np.eye(3)
    x = np.zeros((N, 16))
    x[1, :3] = (0.0, 0.0, -0.4)
    lever = np.array([[[0.0, 0.03, -0.2], [0.04, 0.03, 0.2]]])
    joint = links()._replace(ends=np.array([[0, 1]]), lever=lever)
    kernel.measure_joints(x, joint, room, residual)
    assert residual == pytest.approx(0.04)
    states = np.zeros((1, N, 16))
    states[0, :, :3], states[0, :, 6] = x[:, :3], 1.0
    states[0, 1, :3] += (0.0, 0.3, 0.0)
    out = np.empty((1, 1))
    kernel.measure_smoothed(states, joint, room, out)
    assert out == pytest.approx(np.hypot(0.04, 0.3))


def test_a_kept_state_comes_back_as_it_was() -> None:
    available, other_memory = memory(seed=1), memory(seed=2)
    triu = np.triu(other_memory.P, 1)
    row = np.full(row_length(N, 30) + 1, np.nan)
    kernel.keep_state(available, row[:-1])
    assert np.isfinite(row[:-1]).all()
    assert np.isnan(row[-1])
    kernel.restore_state(other_memory, row)
    for name in ("x", "before", "dx", "refused"):
        np.testing.assert_array_equal(getattr(other_memory, name), getattr(available, name))
    np.testing.assert_array_equal(np.tril(other_memory.P), np.tril(available.P))
    np.testing.assert_array_equal(np.triu(other_memory.P, 1), triu)


def test_a_part_of_the_output_is_a_view_of_it() -> None:
    output = ErkfOutput(*(np.zeros((5, 2)) for _ in range(5)))  # type: ignore[arg-type]
    part = output.part(1, 3)
    for x in part:
        x[:] = 1.0
    assert output.residual[:, 0].tolist() == [0.0, 1.0, 1.0, 0.0, 0.0]
    assert output.smoothed[:, 1].tolist() == [0.0, 1.0, 1.0, 0.0, 0.0]
