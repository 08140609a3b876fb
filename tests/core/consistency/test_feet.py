"""Left and right contradict each other only where contacts are missing, doubled, or of another clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.consistency.doubt import CONTRADICTED
from sagittal.core.events.result import GaitEvent
from sagittal.core.frames import FOOT
from sagittal.core.parameters.between_feet import BETWEEN_FEET
from sagittal.core.parameters.measure import MeasuredGait, Tracks, measure_gait
from sagittal.core.pipeline import analyse
from sagittal.core.simulate import simulate_scenario
from tests.helpers.real_takes import NAMES, analyse_take


@cache
def tracks(name: str = "comfortable") -> Tracks:
    found = analyse(simulate_scenario(name, seed=3, worn=("foot_l", "foot_r")).recording).tracks
    assert found is not None
    return found


def measure(change: Callable[[GaitEvent], list[GaitEvent]]) -> MeasuredGait:
    events = tracks().events
    changed = tuple(sorted((e for x in events.events for e in change(x)), key=lambda e: e.time_s))
    return measure_gait(replace(tracks(), events=replace(events, events=changed)))


def contradicts(gait: MeasuredGait) -> bool:
    told = [n for n in gait.notices if n.code == CONTRADICTED]
    withheld = {p.name for p in gait.parameters if p.reason == CONTRADICTED}
    assert bool(told) == bool(withheld)
    assert withheld <= BETWEEN_FEET
    return bool(told)


def test_a_clean_walk_keeps_all_its_numbers() -> None:
    assert not contradicts(measure(lambda e: [e]))


def test_a_foot_of_which_half_the_contacts_are_missing_withholds_what_is_between_the_feet() -> None:
    """A paretic foot had 64 of 127 contacts, and its cadence and asymmetry came from that half in silence."""
    last = tracks().duration_s
    gait = measure(lambda e: [] if e.side == "right" and e.time_s > 0.55 * last else [e])
    assert contradicts(gait)
    (notice,) = (n for n in gait.notices if n.code == CONTRADICTED)
    assert (notice.sensor, notice.severity) == ("foot_r", "warning")
    assert "cadence_spm" in {p.name for p in gait.parameters if p.reason == CONTRADICTED}
    own = next(p for p in gait.parameters if (p.name, p.side) == ("stride_time_s", "right"))
    assert own.mean == pytest.approx(1.08, abs=0.02)


def test_contacts_found_twice_are_a_contradiction() -> None:
    def double(e: GaitEvent) -> list[GaitEvent]:
        return [e, replace(e, time_s=e.time_s + 0.5)] if e.side == "left" else [e]

    assert contradicts(measure(double))


def test_a_missed_step_or_two_are_none() -> None:
    right = [e.time_s for e in tracks().events.events if e.side == "right" and e.kind == "ic"]
    gone = {right[5], right[20]}
    assert not contradicts(measure(lambda e: [] if e.time_s in gone else [e]))


def test_a_clock_a_tenth_fast_is_a_contradiction_even_where_the_counts_agree() -> None:
    """Bouts end where the first foot ends: the other's contacts there are as many."""
    gait = measure(lambda e: [replace(e, time_s=5.0 + 0.85 * (e.time_s - 5.0)) if e.side == "left" else e])
    assert contradicts(gait)


def test_what_a_lost_sensor_did_not_see_is_not_missing() -> None:
    whole = tracks()
    half = 0.5 * whole.duration_s
    valid = {**whole.valid, FOOT["right"]: whole.valid[FOOT["right"]] & (whole.t_s < half)}
    events = tuple(e for e in whole.events.events if e.side == "left" or e.time_s < half)
    lost = replace(whole, valid=valid, events=replace(whole.events, events=events))
    assert not contradicts(measure_gait(lost))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["hemiparetic", "drop_foot", "crouch", "antalgic", "parkinson", "step_asym", "festination"]
)
def test_nobody_is_accused_for_how_they_walk(name: str) -> None:
    assert not contradicts(measure_gait(tracks(name)))


@pytest.mark.recorded
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_no_real_recording_is_accused(name: str) -> None:
    measured = analyse_take(name).measured
    assert measured is not None
    assert not contradicts(measured)
    assert np.isfinite(next(p.mean or np.nan for p in measured.parameters if p.name == "cadence_spm"))
