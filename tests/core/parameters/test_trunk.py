"""Harmonic ratio and regularity: signals whose answers are known, and simulated pelves."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.events.bouts import Bout
from sagittal.core.events.result import Stride, Strides
from sagittal.core.events.steps import Step, Steps
from sagittal.core.frames import Floats
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.trunk import NAMES, choose_foot, harmonic_ratios, trunk_regularity
from sagittal.core.parameters.walking import step_strides
from sagittal.core.simulate import simulate_scenario
from tests.helpers.true_walks import true_tracks

RATE = 100.0
STRIDE_S = 1.07
T = np.arange(0.0, 22.0, 1.0 / RATE)


def strides(n: int = 18) -> Strides:
    made = []
    for k in range(1, n + 1):
        a, b = k * STRIDE_S, (k + 1) * STRIDE_S
        made.append(Stride("left", a, a + 0.6, b, a + 0.1, 0.5 * (a + b)))
    return Strides(tuple(made))


def wave(*amplitudes: float) -> Floats:
    """Sum of harmonics of the stride's frequency, from the first on."""
    return np.asarray(
        sum(a * np.sin(2 * np.pi * k * T / STRIDE_S + 0.3 * k) for k, a in enumerate(amplitudes, 1))
    )


def found(forward: Floats, sideways: Floats, up: Floats, of: Strides | None = None) -> dict[str, Parameter]:
    acceleration = np.stack((forward, sideways, up), axis=1)
    return {p.name: p for p in trunk_regularity(choose_foot(of or strides()), T, {"pelvis": acceleration})}


def test_the_ratio_is_that_of_the_amplitudes() -> None:
    values = found(wave(0.5, 2.0, 0.0, 1.0), wave(2.0, 0.5), wave(1.0, 3.0))
    assert values["harmonic_ratio_ap"].mean == pytest.approx(3.0 / 0.5, rel=0.02)
    assert values["harmonic_ratio_v"].mean == pytest.approx(3.0, rel=0.02)
    # sideways one swing to the left and one to the right make a stride
    assert values["harmonic_ratio_ml"].mean == pytest.approx(4.0, rel=0.02)
    assert values["harmonic_ratio_ap"].n == 18
    assert values["harmonic_ratio_ap"].unit == ""


def test_only_the_first_twenty_harmonics_count() -> None:
    pieces = np.zeros((3, 1, 200))
    x = np.arange(200) / 200
    for k, a in ((2, 1.0), (3, 0.5), (22, 7.0), (21, 9.0)):
        pieces[:, 0] += a * np.cos(2 * np.pi * k * x)
    assert harmonic_ratios(pieces)["v"][0] == pytest.approx(2.0)


def test_standing_still_has_no_ratio() -> None:
    zero = np.zeros(len(T))
    values = found(zero, zero, zero)
    assert values["harmonic_ratio_v"].mean is None


def test_equal_strides_are_regular_and_unequal_steps_show() -> None:
    even, limping = wave(0.0, 2.0, 0.0, 1.0), wave(1.0, 2.0, 0.5, 1.0)
    values = found(even, even, limping)
    assert values["step_regularity_ap"].mean == pytest.approx(1.0, abs=0.02)
    assert values["stride_regularity_ap"].mean == pytest.approx(1.0, abs=0.02)
    assert values["stride_regularity_v"].mean == pytest.approx(1.0, abs=0.02)
    # even harmonics repeat with every step, odd ones turn their sign: (4 + 1 − 1 − .25) / (4 + 1 + 1 + .25),
    # a little more where the peak has moved
    assert values["step_regularity_v"].mean == pytest.approx(3.75 / 6.25, abs=0.05)


def test_noise_lowers_regularity_of_steps_and_strides_alike() -> None:
    rng = np.random.default_rng(1)
    noisy = wave(0.0, 1.0) + rng.normal(0.0, 1.0, len(T))
    values = found(noisy, noisy, noisy)
    # half a unit of signal power beside one of noise
    assert values["step_regularity_v"].mean == pytest.approx(1 / 3, abs=0.1)
    assert values["stride_regularity_v"].mean == pytest.approx(1 / 3, abs=0.1)


def test_strides_set_aside_are_not_looked_at() -> None:
    clean = wave(0.0, 2.0)
    spoiled = clean.copy()
    spoiled[(T > 6 * STRIDE_S) & (T < 8 * STRIDE_S)] = 50.0
    aside = tuple(
        replace(s, excluded_reason="turn") if 4.5 * STRIDE_S < s.start_s < 8.5 * STRIDE_S else s
        for s in strides().strides
    )
    values = found(spoiled, spoiled, spoiled, Strides(aside))
    assert values["stride_regularity_v"].mean == pytest.approx(1.0, abs=0.02)
    assert values["stride_regularity_v"].n == 14
    assert values["harmonic_ratio_v"].mean == pytest.approx(
        found(clean, clean, clean)["harmonic_ratio_v"].mean, rel=0.5
    )


def test_what_is_missing_has_its_own_reason() -> None:
    nobody = trunk_regularity(choose_foot(strides()), T, {})
    assert {p.reason for p in nobody} == {"no_pelvis_sensor"}
    assert {p.name for p in nobody} == set(NAMES)
    a = wave(0.0, 1.0)
    assert {p.reason for p in found(a, a, a, Strides(())).values()} == {"no_strides"}
    lost = np.full(len(T), np.nan)
    assert {p.reason for p in found(lost, lost, lost).values()} == {"no_forward"}
    upright = found(lost, lost, a)
    assert upright["harmonic_ratio_ap"].reason == "no_forward"
    assert upright["stride_regularity_v"].mean == pytest.approx(1.0, abs=0.02)
    torn = np.where(np.arange(len(T)) % 40 == 0, np.nan, a)
    assert {p.reason for p in found(torn, torn, torn).values()} == {"gap"}
    pairs = found(a, a, a, strides(2))
    assert pairs["stride_regularity_v"].reason == "no_run"
    assert pairs["harmonic_ratio_v"].n == 2


def test_two_steady_steps_of_a_trunk_sensor_are_a_stride() -> None:
    times = [1.0, 1.5, 2.1, 2.6, 3.2, 3.7, 4.3, 4.8, 8.0, 8.5]
    bout = Bout(1.0, 1.0, 8.5, len(times), 0.55, breaks=((4.8, 8.0),))
    steps = Steps(tuple(Step(t, None) for t in times), (bout,), "pelvis")
    # the steps of the first and last stride start and stop the walk
    assert step_strides(steps) == ((2.1, 3.2), (3.2, 4.3))
    stopped = Steps(steps.steps, (replace(bout, breaks=((3.2, 3.7),)),), "pelvis")
    assert step_strides(stopped) == ((2.1, 3.2),)
    assert step_strides(Steps(steps.steps[:3], (replace(bout, end_s=2.1, stops=()),), "pelvis")) == ()


@cache
def simulated(name: str) -> dict[str, float]:
    """Regularity of a simulated pelvis from its true path."""
    truth = simulate_scenario(name, 5).truth
    velocity = np.gradient(truth.p["pelvis"], truth.t_s, axis=0)
    # these walks go straight along x
    acceleration = np.gradient(velocity, truth.t_s, axis=0)
    listed = measure_gait(true_tracks(truth)).strides
    return {
        p.name: p.mean
        for p in trunk_regularity(choose_foot(listed), truth.t_s, {"pelvis": acceleration})
        if p.mean is not None
    }


@pytest.mark.slow
def test_a_hemiparetic_pelvis_is_less_harmonic_than_a_healthy_one() -> None:
    healthy, affected = simulated("comfortable"), simulated("hemiparetic")
    for name in ("harmonic_ratio_v", "harmonic_ratio_ap", "step_regularity_ap", "step_regularity_v"):
        assert affected[name] < 0.8 * healthy[name], name
