"""One late foot shows in the lower back; a limp does not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from sagittal.core.consistency.doubt import LATE_FOOT
from sagittal.core.consistency.echo import judge_echo, measure_echo
from sagittal.core.events.result import GaitEvents
from sagittal.core.parameters.between_feet import BETWEEN_FEET
from sagittal.core.pipeline import TakeAnalysis, analyse, resume
from sagittal.core.simulate import simulate_scenario
from tests.helpers.perturbations import delay_sensor
from tests.helpers.real_takes import analyse_take


@cache
def walk(name: str) -> TakeAnalysis:
    return analyse(simulate_scenario(name, seed=3, worn=("pelvis", "foot_l", "foot_r")).recording)


def shift(events: GaitEvents, late_s: float) -> GaitEvents:
    """Events of the right foot later."""
    moved = (replace(e, time_s=e.time_s + late_s) if e.side == "right" else e for e in events.events)
    return replace(events, events=tuple(sorted(moved, key=lambda e: e.time_s)))


@pytest.mark.parametrize("late_s", [-0.1, -0.04, 0.03, 0.06])
def test_a_late_foot_is_measured(late_s: float) -> None:
    found = walk("healthy")
    assert found.events is not None
    pelvis, rate_hz = found.recording.sensors["pelvis"], found.recording.rate_hz
    clean = measure_echo(pelvis, found.events, rate_hz)
    late = measure_echo(pelvis, shift(found.events, late_s), rate_hz)
    assert clean is not None
    assert late is not None
    assert late.lag_s - clean.lag_s == pytest.approx(late_s, abs=0.006)
    doubt = judge_echo(pelvis, shift(found.events, late_s), rate_hz)
    assert doubt is not None
    assert doubt.notice.sensor == ("foot_r" if late_s > 0 else "foot_l")


def test_a_late_sensor_withholds_what_is_between_the_feet() -> None:
    found = walk("healthy")
    assert found.uniform is not None
    late = resume(replace(found, uniform=delay_sensor(found.uniform, "foot_l", 0.05)), "agreement")
    assert LATE_FOOT in {n.code for n in late.notices}
    assert {p.name for p in late.parameters if p.reason == LATE_FOOT} >= {"step_time_s", "double_support_s"}
    assert {p.name for p in late.parameters if p.reason == LATE_FOOT} <= BETWEEN_FEET


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hemiparetic", "drop_foot", "antalgic", "step_asym", "stiff_knee"])
def test_a_limp_is_no_late_clock(name: str) -> None:
    assert LATE_FOOT not in {n.code for n in walk(name).notices}


@pytest.mark.recorded
@pytest.mark.parametrize("name", ["11-1", "13-4", "14-2"])
def test_real_feet_keep_time(name: str) -> None:
    assert LATE_FOOT not in {n.code for n in analyse_take(name).notices}
