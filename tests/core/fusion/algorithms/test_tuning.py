"""Tuning: variables, required split, and verdict."""

from __future__ import annotations

import json
from dataclasses import replace
from math import inf

import numpy as np
import pytest

from sagittal.core.errors import EstimationError, ParameterError, SignalError
from sagittal.core.fusion.algorithms.benchmark import ReferenceTrial, read_trial
from sagittal.core.fusion.algorithms.gain_space import GainSpace, choose_scheme, gains_to_json
from sagittal.core.fusion.algorithms.gains import FixedGain, FuzzyGain, ThreeLevelGain, TwoLevelGain
from sagittal.core.fusion.algorithms.listed import ALGORITHMS, Algorithm
from sagittal.core.fusion.algorithms.parameters import (
    AquaGains,
    MadgwickGains,
    MahonyGains,
    Nazarahari2021Gains,
)
from sagittal.core.fusion.algorithms.swarm import SwarmRules
from sagittal.core.fusion.algorithms.tuning import GainTuner, TrialSplit, TuningResult
from tests.core.fusion.algorithms.motion import trial_bytes

SHORT = SwarmRules(particles=4, iterations=3, rounds=2, random_rounds=1)


def trial(name: str, seconds: float = 3.0, noise: float = 0.3) -> ReferenceTrial:
    result = read_trial(name, trial_bytes(seconds))
    rng = np.random.default_rng(len(name) + round(10 * seconds))
    return replace(result, acc=result.acc + noise * rng.standard_normal(result.acc.shape))


def split() -> TrialSplit:
    return TrialSplit((trial("one"), trial("two", 4.0)), (trial("judge", 3.5),))


def tune(split: TrialSplit, stop_after: int | None = None, checkpoint: bytes | None = None) -> object:
    """The result, or the checkpoint after some iterations."""
    tuner = GainTuner("mahony_2008", split, scheme="fixed", rules=SHORT, seed=3, code_version="test")
    stored_chunks: list[bytes] = []

    class Stopped(Exception):  # noqa: N818
        pass

    def keep(content: bytes, share: float, message: str) -> None:
        assert 0.0 < share <= 1.0
        assert "° on the trials it is fitted to" in message
        stored_chunks.append(content)
        if len(stored_chunks) == stop_after:
            raise Stopped

    try:
        return tuner.run(keep, None if checkpoint is None else tuner.read_checkpoint(checkpoint))
    except Stopped:
        return stored_chunks[-1]


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
@pytest.mark.parametrize("scheme", ["fixed", "two_levels", "three_levels"])
def test_every_point_of_the_box_is_a_set_of_gains_that_its_class_takes(
    algorithm: Algorithm, scheme: str
) -> None:
    defaults = algorithm.gains()
    for magnetometer in {algorithm.magnetometer != "unused", algorithm.magnetometer == "needed"}:
        chosen = choose_scheme(defaults, scheme, magnetometer=magnetometer)  # type: ignore[arg-type]
        space = GainSpace(chosen, magnetometer=magnetometer)
        rng = np.random.default_rng(0)
        for point in (np.zeros(len(space)), np.ones(len(space)), rng.random(len(space))):
            gains = space.decode(point)
            assert type(gains) is algorithm.gains
            second_content = space.encode(gains)
            assert second_content == pytest.approx(point, abs=1e-3) or scheme == "three_levels"
            json.dumps(gains_to_json(gains), allow_nan=False)


def test_the_variables_are_those_of_the_thesis() -> None:
    """Table 5: Madgwick 2, 5, 8 and 24, with beta, its levels and thresholds, and zeta."""
    for scheme, count in (("fixed", 2), ("two_levels", 5), ("three_levels", 8)):
        gains = choose_scheme(MadgwickGains(), scheme, magnetometer=True)  # type: ignore[arg-type]
        assert len(GainSpace(gains, magnetometer=True)) == count
    corners = (0.02, 0.08, 0.04, 0.1, 0.15, 0.25, 0.2, 0.4)
    fuzzy = MadgwickGains(FuzzyGain(corners, acc=corners, mag=corners))
    assert len(GainSpace(fuzzy, magnetometer=True)) == 24 + 1


def test_without_a_magnetometer_its_gains_and_thresholds_are_left_out() -> None:
    space = GainSpace(MahonyGains(TwoLevelGain(0.1, 0.02, mag=0.1)), magnetometer=False)
    assert space.params == MahonyGains(FixedGain(0.1))
    assert len(space) == 1
    robust = GainSpace(Nazarahari2021Gains(), magnetometer=False)
    assert len(robust) == len({"p0", "sigma_g", "sigma_a", "c_a", "s_a"})
    pair_of = TwoLevelGain(0.1, 0.02, acc=0.1, mag=0.1)
    assert GainSpace(MahonyGains(pair_of), magnetometer=False).params == MahonyGains(
        replace(pair_of, mag=inf)
    )
    three = ThreeLevelGain(1.0, 2.0, 3.0, acc=(0.1, 0.2), mag=(0.1, 0.2))
    left = GainSpace(MahonyGains(three), magnetometer=False).params
    assert left == MahonyGains(replace(three, mag=(inf, inf)))


def test_a_share_that_is_left_is_searched_near_one() -> None:
    space = GainSpace(Nazarahari2021Gains(), magnetometer=True)
    point = space.encode(Nazarahari2021Gains())
    text = space.decode(point)
    assert isinstance(text, Nazarahari2021Gains)
    assert text.c_d == pytest.approx(0.99903, abs=1e-6)
    assert text.gamma == inf


def test_what_is_infinite_is_not_written() -> None:
    written = gains_to_json(Nazarahari2021Gains())
    assert "gamma" not in written
    assert gains_to_json(AquaGains())["sigma_m"] == {"quiet": 0.001, "moving": 0.0, "mag": 0.1}
    assert gains_to_json(MadgwickGains())["beta"] == 0.03


def test_a_split_has_two_halves_and_no_recording_twice() -> None:
    one, two = trial("one"), trial("two", 4.0)
    for train, judge, code in (
        ((one, two), (), "no_validation"),
        ((), (one,), "no_validation"),
        ((one,), (replace(one, name="another"),), "trial_twice"),
        ((one, one), (two,), "trial_twice"),
        ((one,), (replace(two, name="one"),), "trial_twice"),
    ):
        with pytest.raises(ParameterError) as caught:
            TrialSplit(train, judge)
        assert caught.value.code == code
    with pytest.raises(ParameterError) as unknown:
        TrialSplit.by_name((one, two), ["three"])
    assert unknown.value.code == "no_such_trial"
    by_name = TrialSplit.by_name((one, two), ["two"])
    assert (by_name.train, by_name.validate) == ((one,), (two,))


def test_the_hash_is_of_the_samples_and_not_of_the_file() -> None:
    one = trial("one")
    assert one.sha256 == replace(one, name="another").sha256
    assert one.sha256 != replace(one, gyr=one.gyr + 1e-12).sha256


def test_what_cannot_be_tuned_is_refused_before_the_search() -> None:
    with pytest.raises(EstimationError):
        GainTuner("madgwick_2011", split(), magnetometer=False)
    with pytest.raises(ParameterError):
        GainTuner("nothing", split())
    unseen = replace(trial("judge"), reference=np.full_like(trial("judge").reference, np.nan))
    with pytest.raises(SignalError) as caught:
        GainTuner("mahony_2008", TrialSplit((trial("one"),), (unseen,)))
    assert caught.value.code == "no_reference"
    blind = replace(trial("judge"), mag=np.full_like(unseen.mag, np.nan))
    for magnetometer, name in ((True, "mahony_2008"), (None, "madgwick_2011")):
        with pytest.raises(EstimationError, match="judge have none"):
            GainTuner(name, TrialSplit((trial("one"),), (blind,)), magnetometer=magnetometer)
    assert not GainTuner("mahony_2008", TrialSplit((trial("one"),), (blind,)))._uses_mag
    restless = read_trial("judge", trial_bytes(rest_s=0.5))
    with pytest.raises(SignalError):
        GainTuner("mahony_2008", TrialSplit((trial("one"),), (restless,)))


@pytest.mark.slow
def test_a_tuning_stopped_anywhere_and_resumed_ends_with_the_same_bits() -> None:
    halves = split()
    whole = tune(halves)
    assert isinstance(whole, TuningResult)
    for stop in (1, 3, 5, SHORT.steps):
        checkpoint = tune(halves, stop_after=stop)
        assert isinstance(checkpoint, bytes)
        assert tune(halves, checkpoint=checkpoint) == whole
    second = TrialSplit(halves.train, (trial("other", 3.2),))
    assert isinstance(checkpoint, bytes)
    with pytest.raises(ParameterError) as caught:
        tune(second, checkpoint=checkpoint)
    assert caught.value.code == "other_problem"


@pytest.mark.slow
def test_the_result_says_on_what_and_whether_it_is_better() -> None:
    result = tune(split())
    assert isinstance(result, TuningResult)
    assert set(result.trained) == {"one", "two"}
    assert set(result.validated) == {"judge"}
    initial, final = (np.mean([pair[i] for pair in result.trained.values()]) for i in (0, 1))
    assert final <= initial
    assert set(result.data) == {"one", "two", "judge"}
    assert result.improved == result.verdict.startswith("Better")
    assert (result.rules["particles"], result.seed, result.code_version) == (4, 3, "test")
    assert json.loads(json.dumps(result.to_json(), allow_nan=False))["data_sha256"] == result.data_sha256


@pytest.mark.slow
def test_gains_that_only_fit_their_own_trials_are_not_recommended() -> None:
    """Trained where the accelerometer misleads, judged where it is exact and the gyroscope drifts."""
    noisy = trial("noisy", noise=0.0)
    noisy = replace(noisy, acc=noisy.acc + np.where(noisy.moving, 8.0, 0.0)[:, None])
    calm = trial("calm", 20.0, noise=0.0)
    drifting = replace(calm, gyr=calm.gyr + np.where(calm.moving, 0.02, 0.0)[:, None])
    result = tune(TrialSplit((noisy,), (drifting,)))
    assert isinstance(result, TuningResult)
    assert not result.improved
    assert "Keep the initial gains." in result.verdict
