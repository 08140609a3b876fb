"""Time of one evaluation of a tuning, a six-minute trial run and scored, against vqf in the same run."""

from __future__ import annotations

import os

import pytest

from sagittal.core.fusion.algorithms.benchmark import ReferenceTrial, read_trial
from sagittal.core.fusion.algorithms.swarm import SwarmRules
from sagittal.core.fusion.algorithms.tuning import GainTuner, TrialSplit
from sagittal.server.results import tunings
from tests.core.fusion.algorithms.motion import trial_bytes
from validation.bench.test_mahony import best

SIX_MINUTES_S = 360.0
ALONE = 1.5
"""Load of the machine up to which this process may have two cores."""
LIMIT = 2.0
"""Of the time that vqf takes: 20 trials a second where vqf filters 40, as a core shared with others does."""


@pytest.fixture(scope="module")
def trial() -> ReferenceTrial:
    return read_trial("long", trial_bytes(SIX_MINUTES_S))


@pytest.mark.parametrize("name", ["madgwick_2011", "mahony_2008", "valenti_2015", "wu_2016", "marantos_2016"])
def test_one_evaluation_takes_at_most_so_many_of_vqf(trial: ReferenceTrial, name: str) -> None:
    vqf = pytest.importorskip("vqf", reason="vqf is a test extra without a wheel for this Python")
    tuner = GainTuner(name, TrialSplit((trial,), (read_trial("other", trial_bytes(3.0)),)))
    task = (tuner._before, trial)
    tuner._score(task)
    ours, theirs = [], []
    for _ in range(5):
        ours.append(best(lambda: tuner._score(task), 2))
        theirs.append(best(lambda: vqf.VQF(0.01).updateBatch(trial.gyr, trial.acc, trial.mag), 2))
    ratio = min(ours) / min(theirs)
    print(f"\n{name}: {1 / min(ours):.0f} trials a second, vqf {1 / min(theirs):.0f}, ratio {ratio:.2f}")
    assert ratio <= LIMIT


def test_all_cores_work(trial: ReferenceTrial) -> None:
    if (os.cpu_count() or 1) < 2:
        pytest.skip("one core")
    if os.getloadavg()[0] > ALONE:
        pytest.skip("other processes want the cores")
    split = TrialSplit((trial,), (read_trial("other", trial_bytes(3.0)),))
    tuner = GainTuner("mahony_2008", split, rules=SwarmRules(16, 2, 1, 1))
    tuner.run(lambda *_: None)
    single, together = [], []
    # interleaved, so that a busy moment of the machine meets both
    for _ in range(8):
        single.append(best(lambda: tuner.run(lambda *_: None), 1))
        together.append(best(lambda: tunings.search(tuner, lambda *_: None, None), 1))
    print(f"\none thread {min(single):.2f} s, a thread per core {min(together):.2f} s")
    assert min(together) < 0.8 * min(single)
