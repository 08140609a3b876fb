"""Sensors shaken in a hand give no gait parameters."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.consistency.doubt import NOT_WALKING
from sagittal.core.consistency.walking import (
    judge_alternation,
    judge_tilting,
    measure_coincidence,
    measure_tilting,
)
from sagittal.core.events.result import GaitEvents
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.simulate import simulate_scenario


@cache
def walk() -> TakeAnalysis:
    return analyse(simulate_scenario("healthy", seed=3, worn=("pelvis", "foot_l", "foot_r")).recording)


def events() -> GaitEvents:
    found = walk().events
    assert found is not None
    return found


def land_together() -> GaitEvents:
    """The left foot's events, and the same ones of the right foot 10 ms later."""
    left = [e for e in events().events if e.side == "left"]
    both = [*left, *(replace(e, side="right", time_s=e.time_s + 0.01) for e in left)]
    return replace(events(), events=tuple(sorted(both, key=lambda e: e.time_s)))


def test_feet_that_walk_land_in_turn() -> None:
    assert measure_coincidence(events()) == 0.0
    assert judge_alternation(events()) is None
    assert measure_coincidence(GaitEvents(())) is None


def test_contacts_detected_twice_are_a_walk() -> None:
    doubled = [replace(e, time_s=e.time_s + 0.5) for e in events().events if e.side == "left"]
    both = replace(events(), events=tuple(sorted((*events().events, *doubled), key=lambda e: e.time_s)))
    assert measure_coincidence(both) == pytest.approx(0.5, abs=0.1)
    assert judge_alternation(both) is None


def test_feet_that_land_together_have_no_gait_parameters() -> None:
    tracks = walk().tracks
    assert tracks is not None
    gait = measure_gait(replace(tracks, events=land_together()))
    assert [n.code for n in gait.notices if n.code == NOT_WALKING] == [NOT_WALKING]
    assert all(p.mean is None for p in gait.parameters)
    assert "cadence_spm" in {p.name for p in gait.parameters if p.reason == NOT_WALKING}


def test_a_trunk_that_is_shaken_does_not_walk() -> None:
    recording, measured = walk().recording, walk().measured
    assert measured is not None
    pelvis, t = recording.sensors["pelvis"], recording.t_s
    calm = measure_tilting(pelvis, t, measured.bouts, recording.rate_hz)
    assert calm is not None
    assert np.degrees(calm) < 30.0
    shake = np.radians(150.0) * np.sin(2 * np.pi * 1.5 * t)[:, None] * np.array([1.0, 0.5, 0.0])
    shaken = replace(pelvis, gyr=pelvis.gyr + shake)
    assert judge_tilting("pelvis", pelvis, t, measured.bouts, recording.rate_hz) is None
    doubt = judge_tilting("pelvis", shaken, t, measured.bouts, recording.rate_hz)
    assert doubt is not None
    assert doubt.scope == "all"
    assert judge_tilting("pelvis", shaken, t, (), recording.rate_hz) is None
