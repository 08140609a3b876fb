"""The twelve correctors, uncompiled: stable at the truth, converging from errors."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import radians

import numpy as np
import pytest

from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms import complementary
from sagittal.core.fusion.algorithms.complementary import (
    BIAS,
    CONSTANTS,
    FRACTIONS,
    GAINS,
    KINDS,
    LEARNS_BIAS,
)
from sagittal.core.fusion.algorithms.engines import Setting, prepare_complementary
from sagittal.core.fusion.algorithms.listed import ALGORITHMS
from sagittal.core.rotation import angle_between, conjugate, exp, multiply, rotate
from tests.helpers.uncompiled import run_uncompiled

RATE = 100.0
FIELD = np.array([0.0, 0.5, -(0.75**0.5)])
UP = np.array([0.0, 0.0, 1.0])
TRUE = exp(np.array([0.3, -0.5, 0.8]))
MOST_S = 3.0

every = pytest.mark.parametrize("kind", KINDS)


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    run_uncompiled(monkeypatch, complementary)


@cache
def by_kind() -> dict[str, type]:
    """Gains of an algorithm of each corrector that can use a magnetometer."""
    return {a.kind: a.gains for a in reversed(ALGORITHMS) if a.engine == "E1" and a.magnetometer != "unused"}


def run(
    kind: str,
    start: Floats,
    samples: int,
    gyr: Floats | None = None,
    *,
    acc: bool = True,
    mag: bool = True,
    gains: Mapping[str, float] | None = None,
) -> tuple[Floats, Floats]:
    """Orientations (n, 4) of a sensor that rests in TRUE, and its state."""
    inputs = prepare_complementary(
        kind, Setting(by_kind()[kind](**(gains or {})), RATE, start[None], FIELD[None], True)
    )
    none = np.full((samples, 1, 3), np.nan)
    out = np.empty((samples, 1, 4))
    back = conjugate(TRUE)
    inputs.run(
        np.zeros((samples, 1, 3)) if gyr is None else np.broadcast_to(gyr, (samples, 1, 3)).copy(),
        np.broadcast_to(rotate(back, UP), (samples, 1, 3)).copy() if acc else none,
        np.broadcast_to(rotate(back, FIELD), (samples, 1, 3)).copy() if mag else none,
        inputs.state,
        out,
    )
    return out[:, 0], inputs.state[0]


def off(q: Floats) -> Floats:
    return np.asarray(np.degrees(angle_between(q, np.broadcast_to(TRUE, q.shape))))


@every
def test_every_corrector_has_an_algorithm_and_its_gains(kind: str) -> None:
    gains = by_kind()[kind]()
    for name in (*GAINS[kind], *CONSTANTS[kind]):
        assert hasattr(gains, name), name
    assert set(FRACTIONS.get(kind, ())) <= {*GAINS[kind], *CONSTANTS[kind]}
    assert set(LEARNS_BIAS.get(kind, ())) <= set(CONSTANTS[kind])


@every
def test_what_is_right_stays_right(kind: str) -> None:
    q, state = run(kind, TRUE, 30)
    assert off(q).max() < 0.05
    assert np.linalg.norm(q, axis=1) == pytest.approx(1.0)
    assert state[:4] == pytest.approx(q[-1])
    assert np.abs(state[BIAS : BIAS + 3]).max() < radians(0.2)


@every
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)], ids=["tilt", "heading"])
def test_what_is_wrong_becomes_less_wrong(kind: str, axis: tuple[float, float, float]) -> None:
    wrong = multiply(exp(radians(8.0) * np.array(axis)), TRUE)
    errors = off(run(kind, wrong, 60)[0])
    assert errors[-1] < errors[0] < 8.01
    assert errors[-1] < 7.9


@every
def test_without_readings_the_gyroscope_alone_turns_it(kind: str) -> None:
    rate = np.array([0.4, -1.0, 0.6])
    q, _ = run(kind, TRUE, 50, rate, acc=False, mag=False)
    assert q[-1] * np.sign(q[-1] @ TRUE) == pytest.approx(
        multiply(TRUE, exp(0.5 * rate)) * np.sign(multiply(TRUE, exp(0.5 * rate)) @ TRUE), abs=1e-6
    )


@every
def test_without_a_field_the_tilt_is_mended_and_the_heading_left(kind: str) -> None:
    wrong = multiply(exp(np.array([radians(8.0), 0.0, 0.0])), TRUE)
    q, _ = run(kind, wrong, 60, mag=False)
    up = rotate(q[[0, -1]], np.broadcast_to(rotate(conjugate(TRUE), UP), (2, 3)))
    tilts = np.degrees(np.arccos(np.clip(up[:, 2], -1.0, 1.0)))
    assert tilts[1] < tilts[0]
    turned = multiply(exp(np.array([0.0, 0.0, radians(20.0)])), TRUE)
    assert off(run(kind, turned, 20, mag=False)[0])[-1] == pytest.approx(20.0, abs=0.2)


@pytest.mark.parametrize("kind", sorted(LEARNS_BIAS))
@pytest.mark.parametrize("axis", range(3))
def test_a_bias_is_learnt_with_its_sign(kind: str, axis: int) -> None:
    gains = dict.fromkeys((n for n in LEARNS_BIAS[kind] if n != "kb"), 0.2)
    for rate in (0.02, -0.02):
        _, state = run(kind, TRUE, 50, rate * np.eye(3)[axis], gains=gains)
        assert state[BIAS + axis] * np.sign(rate) > 1e-5
