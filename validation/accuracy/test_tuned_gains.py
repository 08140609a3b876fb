"""Shipped gains compared with defaults: on fitted walkers, on others, on real optical segments."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sagittal.core.fusion.algorithms.benchmark import run_trial, score_orientation
from sagittal.core.fusion.algorithms.listed import BY_NAME
from sagittal.core.fusion.algorithms.parameters import AlgorithmGains
from sagittal.core.fusion.algorithms.presets import TUNED_ON_WALKERS, BodyPlace
from tests.helpers.optical_segments import SegmentTrial, gaitmap_feet, inclination_rms, neura_segments
from validation.accuracy.tuned_walks import CHECKED, FITTED, PLACEMENTS, Person, trial
from validation.figures import record

NAMES = tuple(dict.fromkeys(name for name, _ in TUNED_ON_WALKERS))
WORSE_DEG = 0.5
"""Most by which tuned gains may be worse than the defaults on a real recording: no more than two optical
references of one segment differ by."""


def on_walkers(
    name: str, place: BodyPlace, people: tuple[Person, ...], gains: AlgorithmGains | None
) -> float:
    """Mean RMS inclination in degrees."""
    result = []
    for person in people:
        walk = trial(person, place)
        q = run_trial(name, walk, gains, magnetometer=False)
        result.append(math.degrees(score_orientation(q, walk).inclination))
    return float(np.mean(result))


def on_people(
    name: str, place: BodyPlace, trials: tuple[SegmentTrial, ...], gains: AlgorithmGains | None
) -> float | None:
    """The same on real segments; None where the recording has none there."""
    degrees = [
        math.degrees(inclination_rms(run_trial(name, t.trial, gains, magnetometer=False), t))
        for t in trials
        if t.placement == place
    ]
    return float(np.mean(degrees)) if degrees else None


@pytest.mark.parametrize("name", NAMES)
def test_tuned_gains_are_better_on_people_they_were_not_fitted_to(name: str) -> None:
    for place in PLACEMENTS:
        gains = TUNED_ON_WALKERS.get((name, place))
        if gains is not None:
            initial, final = (on_walkers(name, place, CHECKED, g) for g in (None, gains))
            assert final < initial, place


def test_what_they_do_on_real_recordings_is_written_down() -> None:
    rows = []
    for name in NAMES:
        for place in PLACEMENTS:
            gains = TUNED_ON_WALKERS.get((name, place))
            if gains is None:
                continue
            row = [BY_NAME[name].shown, place]
            row += [
                _pair(*(on_walkers(name, place, people, g) for g in (None, gains)))
                for people in (FITTED, CHECKED)
            ]
            for real in (neura_segments(), gaitmap_feet()):
                initial, final = (on_people(name, place, real, g) for g in (None, gains))
                row.append(_pair(initial, final))
                if initial is not None and final is not None:
                    assert final < initial + WORSE_DEG, (name, place)
            rows.append(row)
    record(
        "Tuned gains on walking",
        ["algorithm", "on", "8 simulated, fitted to", "6 simulated, others", "neura_walk", "gaitmap_foot"],
        rows,
        "RMS inclination in degrees without a magnetometer, default → tuned gains "
        "(docs/science/filters.md, “Tuning”). Simulated: sensors on skin, shocks, a bias left by the "
        "rest; the accelerations of simulated thighs and shanks are 1.5 to 2.5 times those of people, "
        "so gains fitted to them trust the accelerometer less than they could. Real: one walk of 9.5 "
        "s beside Vicon, two feet over 2 × 20 m beside markers, run backwards because only its end is "
        "still; the constant turn between sensor and segment is fitted, skin and markers are in the "
        "error. Two takes, two people: they show whether a set does harm, not how good it is. The "
        "bias that simulated rests leave was chosen after a look at how integration alone drifts on "
        "these two, so for that number they are not unseen.",
    )


def _pair(earlier: float | None, later: float | None) -> str:
    return "–" if earlier is None or later is None else f"{earlier:.2f} → {later:.2f}"
