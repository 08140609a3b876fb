"""A treadmill's belt moves under the foot: what the report says then.

To the sensors an even belt is the floor, so nothing they measure tells a treadmill; the protocol does.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.parameters.spatial import NAMES
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.signals.recording import Recording
from sagittal.core.simulate import simulate_scenario

BELT = 1.1


def recording() -> Recording:
    return simulate_scenario("comfortable", 3).recording


@cache
def walked(belt_speed_mps: float | None) -> TakeAnalysis:
    return analyse(replace(recording(), protocol="treadmill", belt_speed_mps=belt_speed_mps))


@pytest.mark.sweep
def test_without_the_belts_speed_every_distance_is_withheld_with_the_reason() -> None:
    found = {p.name: p for p in walked(None).parameters}
    for name in (*NAMES, "total_distance_m"):
        assert (found[name].mean, found[name].reason) == (None, "treadmill"), name
    assert "treadmill_belt" in {n.code for n in walked(None).notices}


@pytest.mark.sweep
def test_the_belts_speed_gives_speed_and_stride_length_and_nothing_else() -> None:
    found = {(p.name, p.side): p for p in walked(BELT).parameters}
    assert found["gait_speed_mps", None].mean == pytest.approx(BELT)
    for side in ("left", "right"):
        time, length = (found[name, side].mean for name in ("stride_time_s", "stride_length_m"))
        assert time is not None
        assert length == pytest.approx(BELT * time)
    others = {name for name, _ in found if name in NAMES} - {"gait_speed_mps", "stride_length_m"}
    assert {found[key].reason for key in found if key[0] in others} == {"treadmill"}


@pytest.mark.sweep
def test_angles_and_times_are_those_of_the_same_steps_on_the_floor() -> None:
    floor = {(p.name, p.side): p.mean for p in analyse(recording()).parameters}
    belt = {(p.name, p.side): p.mean for p in walked(BELT).parameters}
    for name in ("knee_flexion_rom_deg", "stance_time_s", "cadence_spm"):
        for key in (k for k in floor if k[0] == name):
            assert belt[key] == pytest.approx(floor[key]), key


@pytest.mark.sweep
def test_a_belts_speed_without_a_treadmill_is_refused() -> None:
    with pytest.raises(ParameterError) as caught:
        replace(recording(), belt_speed_mps=BELT)
    assert caught.value.code == "belt_speed_without_treadmill"
