"""Contacts and temporal parameters against the exact truth of simulated walks.

The rule sees the landing pitch peak that the simulator shapes to be at contact (docs/science/simulation.md),
so the small errors here say that the code is right, not how people land; validation/accuracy says that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from sagittal.core import calibration, events, timeline
from sagittal.core.events.result import GaitEvents, Stride, Strides
from sagittal.core.frames import SIDES
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.parameters import stride_values, summarise_times
from sagittal.core.simulate import Simulation, simulate_scenario
from tests.helpers.event_scoring import match

SCENARIOS = ("comfortable", "fast_with_turns")


@dataclass(frozen=True)
class Walked:
    """A simulated walk, and what was found on the true and on the estimated orientations."""

    simulation: Simulation
    of_truth: GaitEvents
    of_chain: GaitEvents
    strides: Strides


@pytest.fixture(scope="module", params=SCENARIOS)
def walked(request: pytest.FixtureRequest) -> Walked:
    simulation = simulate_scenario(request.param, seed=3)
    truth = simulation.truth
    n = len(truth.t_s)
    exact = Orientations(
        truth.t_s, truth.rate_hz, truth.q, {s: np.ones(n, np.bool_) for s in truth.q}, "truth"
    )
    calibrated = calibration.calibrate(timeline.synchronise(simulation.recording))
    orientations = estimate_orientations(calibrated)
    found = events.detect(orientations)
    strides = events.stride_list(found, orientations, calibrated.calibration.turning)
    return Walked(simulation, events.detect(exact), found, strides)


@pytest.mark.slow
@pytest.mark.parametrize("source", ["of_truth", "of_chain"])
def test_every_contact_is_found_and_none_is_invented(walked: Walked, source: str) -> None:
    """docs/science/events.md, "Limits on real walks": none extra, IC ±10 ms; TC against the 5 mm lift."""
    found: GaitEvents = getattr(walked, source)
    for side in SIDES:
        truth = walked.simulation.truth.contacts[side]
        ic = match(found.times(side, "ic"), truth.contact.tolist())
        assert (ic.missed, ic.extra) == (0, ())
        assert abs(ic.mean_ms) <= 10
        assert float(np.median(np.abs(ic.errors))) <= 0.005
        lift = truth.lift5[np.isfinite(truth.lift5)]
        tc = match(found.times(side, "tc"), lift.tolist())
        assert (tc.missed, tc.extra) == (0, ())
        assert 15 <= tc.mean_ms <= 45, "the pitch minimum follows the lift by about 30 ms"
        assert tc.sd_ms <= 15


@pytest.mark.slow
def test_counted_strides_have_the_true_times(walked: Walked) -> None:
    true = walked.simulation.truth.strides
    errors = []
    stance = []
    for s in walked.strides.select_used():
        (own,) = (t for t in true if t.side == s.side and abs(t.start_s - s.start_s) < 0.2)
        errors.append(s.duration_s - (own.end_s - own.start_s))
        assert own.lift5_s is not None
        assert s.tc_s is not None
        stance.append((s.tc_s - s.start_s) - (own.lift5_s - own.start_s))
        assert abs(own.turn_rad) < np.radians(30.0)
    assert len(errors) > 40
    assert abs(np.mean(errors)) < 0.003
    assert np.std(errors) < 0.010
    assert 0.015 <= np.mean(stance) <= 0.045


@pytest.mark.slow
def test_turning_strides_are_those_that_turn(walked: Walked) -> None:
    """Every true stride turning by more than 30° is set aside as turn; no straight one is."""
    true = walked.simulation.truth.strides

    def own(s: Stride) -> float | None:
        turns = [t.turn_rad for t in true if t.side == s.side and abs(t.start_s - s.start_s) < 0.2]
        return turns[0] if turns else None

    pairs = [(s, turn) for s in walked.strides.strides if (turn := own(s)) is not None]
    for s, turn in pairs:
        if abs(turn) > np.radians(30.0):
            assert s.excluded_reason == "turn"
        if s.turn_rad is not None:
            assert s.turn_rad == pytest.approx(turn, abs=np.radians(12.0))


def test_parameters_have_the_true_means(walked: Walked) -> None:
    found = {(p.name, p.side): p for p in summarise_times(walked.strides)}
    used = walked.strides.select_used()
    true = [
        t
        for t in walked.simulation.truth.strides
        if any(s.side == t.side and abs(t.start_s - s.start_s) < 0.2 for s in used)
    ]
    for side in SIDES:
        mean = float(np.mean([t.end_s - t.start_s for t in true if t.side == side]))
        assert found["stride_time_s", side].mean == pytest.approx(mean, abs=0.003)
        stance = found["stance_pct", side].mean
        swing = found["swing_pct", side].mean
        assert stance is not None
        assert swing is not None
        assert stance + swing == pytest.approx(100.0)
    steps = float(np.mean([v for s in used if (v := stride_values(s)["step_time_s"]) is not None]))
    cadence = found["cadence_spm", None]
    assert cadence.mean == pytest.approx(60.0 / steps)
    true_step = float(np.mean([t.end_s - t.start_s for t in true])) / 2
    assert cadence.mean == pytest.approx(60.0 / true_step, rel=0.01)


def test_symmetric_walking_is_symmetric(walked: Walked) -> None:
    found = {(p.name, p.side): p.mean for p in summarise_times(walked.strides)}
    left, right = found["stance_time_s", "left"], found["stance_time_s", "right"]
    assert left is not None
    assert right is not None
    assert 0.97 < left / right < 1.03
