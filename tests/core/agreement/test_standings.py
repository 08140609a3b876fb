"""Slips at the start and end of a walk, detected from standings; no stability is claimed unseen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.agreement import AgreementParams, check_agreement
from sagittal.core.agreement.params import SlipParams
from sagittal.core.frames import Segment
from sagittal.core.pipeline import resume
from sagittal.core.signals.recording import UniformRecording
from tests.helpers.perturbations import slip_sensor
from tests.helpers.walks import analysed, cut, neura_walk, only, simulated

BEFORE_S = 4.5
"""The person walks from 5.3 s on."""


def walk() -> UniformRecording:
    simulation = simulated("comfortable", 1)[0]
    return only(simulation, *(s for s in simulation.sensors if s != "chest"))


@pytest.mark.slow
@pytest.mark.parametrize("segment", ["thigh_l", "shank_r", "foot_l"])
@pytest.mark.parametrize("by_deg", [15.0, -15.0])
def test_a_slip_before_the_walk_leaves_the_sensor_out(segment: Segment, by_deg: float) -> None:
    agreement = check_agreement(slip_sensor(walk(), segment, np.radians(by_deg), BEFORE_S))
    assert [(x.segment, x.at_rest) for x in agreement.slips] == [(segment, True)]
    slip = agreement.slips[0]
    assert abs(np.degrees(slip.turn_rad)) == pytest.approx(15.0, abs=4.0)
    assert abs(slip.at_s - BEFORE_S) < slip.within_s + 0.5
    assert not agreement.recording.sensors[segment].valid.any()
    assert [n.code for n in agreement.recording.notices] == ["sensor_slipped"]


@pytest.mark.slow
@pytest.mark.parametrize("at_s", [10.5, 11.5, 12.5])
@pytest.mark.parametrize("segment", ["thigh_l", "shank_l", "foot_l"])
def test_a_real_one_is_found_about_the_first_steps(segment: Segment, at_s: float) -> None:
    take = neura_walk()
    for by_deg in (15.0, -15.0):
        agreement = check_agreement(slip_sensor(take, segment, np.radians(by_deg), at_s))
        assert [x.segment for x in agreement.slips] == [segment]


@pytest.mark.slow
def test_a_leg_that_stands_elsewhere_has_not_slipped() -> None:
    """Thigh and shank of a leg put forward rotate alike, also if only before the walk."""
    target = slip_sensor(walk(), "thigh_l", np.radians(12.0), BEFORE_S)
    forward = slip_sensor(target, "shank_l", np.radians(12.0), BEFORE_S)
    backward = slip_sensor(target, "shank_l", -np.radians(12.0), BEFORE_S)
    assert check_agreement(forward).slips == check_agreement(backward).slips == ()


@pytest.mark.recorded
def test_without_a_standing_at_both_ends_nothing_is_told_or_vouched_for() -> None:
    take = cut(neura_walk(), 0.0, 20.0)
    agreement = check_agreement(slip_sensor(take, "thigh_l", np.radians(15.0), 11.5))
    assert agreement.slips == ()
    assert agreement.judged_places == {}


@pytest.mark.recorded
def test_standing_before_and_after_vouches_for_the_walk_between() -> None:
    agreement = check_agreement(neura_walk())
    assert set(agreement.judged_places) == {s for s in neura_walk().sensors if s != "pelvis"}
    for start, end in agreement.judged_places.values():
        assert start < 11.0
        assert end > 21.0
    # a slip with the last step is not told, and its place is not vouched for
    late = check_agreement(slip_sensor(neura_walk(), "shank_l", np.radians(15.0), 19.0))
    assert late.judged_places.get("shank_l", (0.0, 0.0))[1] < 19.0


def test_a_forbidden_repair_leaves_the_signals() -> None:
    slipped = slip_sensor(walk(), "thigh_l", np.radians(15.0), BEFORE_S)
    agreement = check_agreement(slipped, AgreementParams(slips=SlipParams(repair=False)))
    assert agreement.recording.sensors["thigh_l"] is slipped.sensors["thigh_l"]
    assert agreement.doubtful["thigh_l"] == (-np.inf, np.inf)


@pytest.mark.sweep
@pytest.mark.parametrize("segment", ["thigh_l", "shank_l", "foot_l"])
def test_no_figure_rests_on_a_sensor_that_slipped_before_the_walk(segment: Segment) -> None:
    right = analysed("healthy", 5)
    slipped = slip_sensor(right.recording, segment, np.radians(15.0), BEFORE_S)
    resumed_run = resume(replace(right, uniform=slipped), "agreement")
    assert "sensor_slipped" in {n.code for n in resumed_run.notices}
    truth = {(p.name, p.side): p.mean for p in right.parameters}
    for p in resumed_run.parameters:
        mean = truth[p.name, p.side]
        if p.mean is not None and p.uncertainty is not None and mean is not None:
            assert abs(p.mean - mean) <= p.uncertainty, (p.name, p.side)


@pytest.mark.recorded
def test_the_standings_clear_a_sensor_that_its_joint_blames() -> None:
    """The ankle of this real walk blames the foot where the shank slipped 1.5 s after the first step."""
    for by_deg in (15.0, -15.0):
        agreement = check_agreement(slip_sensor(neura_walk(), "shank_r", np.radians(by_deg), 12.5))
        assert [x.segment for x in agreement.slips] == ["shank_r"]
