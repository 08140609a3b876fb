"""From gains to a ready filter: effects of the rate and of a missing magnetometer."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.fusion.algorithms import complementary, parameters
from sagittal.core.fusion.algorithms.engines import GAINS_RATE_HZ, PREPARE, Setting, prepare_complementary
from sagittal.core.fusion.algorithms.gains import WIDTH, FixedGain, TwoLevelGain
from sagittal.core.fusion.algorithms.listed import ALGORITHMS, Algorithm
from sagittal.core.rotation import exp

Q = exp(np.array([[0.1, 0.2, 0.3], [0.0, -0.4, 0.0]]))
FIELD = np.tile([0.0, 0.6, -0.8], (2, 1))


def setting(params: object, rate_hz: float = GAINS_RATE_HZ, *, has_mag: bool = True) -> Setting:
    return Setting(params, rate_hz, Q, FIELD, has_mag)  # type: ignore[arg-type]


def test_what_is_left_of_a_sample_is_the_same_after_a_second_at_every_rate() -> None:
    for rate_hz in (25.0, 100.0, 400.0):
        assert setting(None, rate_hz).decay(0.99) ** rate_hz == pytest.approx(0.99**100)


@pytest.mark.parametrize("share", [0.5, 0.99])
def test_a_driven_state_spreads_alike_in_the_long_run(share: float) -> None:
    for rate_hz in (25.0, 400.0):
        inputs = setting(None, rate_hz)
        spread = inputs.drive(2.0, share) / (1.0 - inputs.decay(share) ** 2)
        assert spread == pytest.approx(2.0 / (1.0 - share**2))
    assert setting(None).drive(2.0, share) == pytest.approx(2.0)


def test_what_never_decays_walks_as_far_in_a_second() -> None:
    assert setting(None, 25.0).drive(2.0, 1.0) * 25.0 == pytest.approx(200.0)


def test_gains_and_constants_are_read_by_name_and_zero_where_there_are_none() -> None:
    params = parameters.MadgwickGains(beta=TwoLevelGain(0.1, 0.2, acc=0.05))
    rows = setting(params).rows(("none", "beta"), lambda name, x: x * 10.0 if name == "beta" else x)
    assert rows.shape == (2, WIDTH)
    assert rows[0, :3].tolist() == [0.0, 0.0, 0.0]
    assert rows[1, :2] == pytest.approx([1.0, 2.0])
    assert 0.05 in rows[1].tolist(), "a threshold is no gain"
    assert setting(params).rows((), lambda _, x: x).shape == (0, WIDTH)
    assert setting(params).constants(("zeta", "none")) == {"zeta": params.zeta, "none": 0.0}
    assert setting(params, 400.0).noise_rows(("beta",))[0, 0] == pytest.approx(0.1 * sqrt(4.0))


def test_a_share_of_an_error_is_at_most_all_of_it() -> None:
    good = parameters.JustaGains(sigma_a=FixedGain(1.0))
    prepare_complementary("justa", setting(good, 50.0))
    with pytest.raises(ParameterError, match="Gain sigma_a is a share of an error") as refused:
        prepare_complementary("justa", setting(replace(good, sigma_a=FixedGain(1.1))))
    assert refused.value.code == "gain_out_of_range"


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_every_algorithm_starts_at_the_orientations_it_is_given(algorithm: Algorithm) -> None:
    prepared = PREPARE[algorithm.engine](algorithm.kind, setting(algorithm.gains(), 60.0))
    assert prepared.state[:, :4] == pytest.approx(Q)
    assert np.isfinite(prepared.state).all()
    if prepared.bias is not None:
        assert not prepared.state[:, prepared.bias : prepared.bias + 3].any()


def test_without_a_magnetometer_no_bias_about_the_vertical_is_learnt(monkeypatch: pytest.MonkeyPatch) -> None:
    requests: list[list[float]] = []

    def listen(*inputs: object) -> None:
        requests.append(list(inputs[7]))  # type: ignore[call-overload]

    monkeypatch.setattr(complementary, "run_complementary", listen)
    none = np.empty((0, 2, 3))
    for has_mag in (True, False):
        result = prepare_complementary("gd", setting(parameters.MadgwickGains(zeta=0.05), has_mag=has_mag))
        result.run(none, none, none, result.state, np.empty((0, 2, 4)))
    assert requests == [[0.05, 0.0], [0.0, 0.0]]
