"""Timed up and go and five rises by one trunk sensor, on simulated people with known segments."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.events.turns import find_turns
from sagittal.core.frames import Segment
from sagittal.core.functional_tests.chair import measure_chair_rises
from sagittal.core.functional_tests.result import FunctionalTest
from sagittal.core.functional_tests.rising import find_changes
from sagittal.core.functional_tests.trunk import TrunkMotion, follow_trunk
from sagittal.core.functional_tests.tug import measure_tug
from sagittal.core.signals.recording import GivenLimits, Recording, UniformRecording
from sagittal.core.simulate import PostureHold, simulate_day
from sagittal.core.simulate.scripts import ON_SKIN
from sagittal.core.simulate.tug import ChairTruth, simulate_chair_rises, simulate_tug
from sagittal.core.timeline import synchronise
from tests.helpers.kept import keep

WORN: tuple[Segment, ...] = ("pelvis", "chest")


@keep
def tug(patient: str = "healthy", seed: int = 1, left: bool = True) -> tuple[UniformRecording, ChairTruth]:
    simulation = simulate_tug(patient, seed, setup=replace(ON_SKIN, worn=WORN), left=left)
    return synchronise(simulation.recording), simulation.truth


@keep
def rises(
    patient: str = "elderly", repetitions: int = 5, pause_s: float = 0.3
) -> tuple[UniformRecording, ChairTruth]:
    chair_rises = simulate_chair_rises(
        patient, 1, setup=replace(ON_SKIN, worn=WORN), repetitions=repetitions, pause_s=pause_s
    )
    return synchronise(chair_rises.recording), chair_rises.truth


def wear(take: UniformRecording, segment: Segment) -> UniformRecording:
    return replace(take, sensors={segment: take.sensors[segment]})


@cache
def trunk(segment: Segment = "pelvis") -> TrunkMotion:
    return follow_trunk(wear(tug()[0], segment))


def means(test: FunctionalTest) -> dict[str, float | None]:
    return {p.name: p.mean for p in test.parameters}


def reasons(test: FunctionalTest) -> set[str | None]:
    return {p.reason for p in test.parameters}


@pytest.mark.parametrize("segment", WORN)
def test_the_segments_follow_each_other_and_are_the_true_ones(segment: Segment) -> None:
    result = measure_tug(trunk(segment))
    truth = tug()[1]
    names = ("sit_to_stand", "walk_out", "turn", "walk_back", "turn_to_sit")
    assert tuple(s.name for s in result.segments) == names
    for initial, final in zip(result.segments[:-1], result.segments[1:], strict=True):
        assert initial.end_s == final.start_s
    true = {p.kind: p.end_s - p.start_s for p in truth.segments}
    got = means(result)
    for name in (*names, "final_turn", "stand_to_sit"):
        assert got[f"tug_{name}_s"] == pytest.approx(true[name], abs=0.2)
    assert got["tug_duration_s"] == pytest.approx(truth.duration_s, abs=0.1)
    assert result.sensor == segment


def test_the_pelvis_is_asked_before_the_chest() -> None:
    assert follow_trunk(tug()[0]).segment == "pelvis"


@pytest.mark.slow
def test_turns_have_their_angle_and_direction() -> None:
    for left in (True, False):
        motion = follow_trunk(wear(tug(left=left)[0], "pelvis"))
        turns = find_turns(motion.yaw_rate, motion.valid, motion.rate_hz)
        assert [t.direction for t in turns] == ["left" if left else "right"] * 2
        assert np.degrees([abs(t.angle_rad) for t in turns]) == pytest.approx([180.0, 180.0], abs=6.0)


def test_a_person_may_say_when_it_began_and_ended() -> None:
    free, inputs = measure_tug(trunk()), measure_tug(trunk(), GivenLimits(3.5, 18.5))
    assert inputs.corrected
    assert not free.corrected
    got, was = means(inputs), means(free)
    assert got["tug_duration_s"] == pytest.approx(15.0)
    assert got["tug_turn_s"] == was["tug_turn_s"]
    assert free.start_s is not None
    rise, initial = got["tug_sit_to_stand_s"], was["tug_sit_to_stand_s"]
    assert rise is not None
    assert initial is not None
    assert rise - initial == pytest.approx(free.start_s - 3.5)


def test_limits_make_sense() -> None:
    with pytest.raises(ParameterError, match="expected times"):
        GivenLimits(5.0, 4.0)
    with pytest.raises(ParameterError, match="expected times"):
        GivenLimits(-1.0)


def test_what_is_missing_has_its_reason() -> None:
    t_s = trunk().t_s
    assert reasons(measure_tug(trunk(), GivenLimits(start_s=float(t_s[-1]) - 1.0))) == {"no_sit_down"}
    (motion, truth), five = rises(), measure_tug(follow_trunk(wear(rises()[0], "pelvis")))
    assert len(truth.changes) == 10
    assert motion.rate_hz == 100.0
    # the times are there, the turns are not
    assert {p.name for p in five.parameters if p.reason == "turn_missing"} >= {"tug_turn_s", "tug_walk_out_s"}


def test_nobody_rises_while_walking() -> None:
    day = simulate_day(
        (PostureHold("stand", 4.0), PostureHold("walk", 12.0), PostureHold("stand", 4.0)), seed=1
    )
    motion = follow_trunk(synchronise(day.recording))
    assert find_changes(motion) == ()
    assert reasons(measure_tug(motion)) == {"no_rise"}
    assert reasons(measure_chair_rises(motion)) == {"no_rise"}


def test_rises_of_a_chest_are_those_of_the_day() -> None:
    day = simulate_day((PostureHold("sit", 5.0), PostureHold("stand", 4.0), PostureHold("sit", 5.0)), seed=2)
    changes = find_changes(follow_trunk(synchronise(day.recording)))
    assert [c.kind for c in changes] == ["sit_to_stand", "stand_to_sit"]
    assert [c.height_m for c in changes] == pytest.approx([0.4, -0.4], abs=0.1)


@pytest.mark.parametrize("segment", WORN)
def test_five_rises(segment: Segment) -> None:
    take, truth = rises()
    chair_rises = measure_chair_rises(follow_trunk(wear(take, segment)))
    got = means(chair_rises)
    assert got["five_sit_to_stand_s"] == pytest.approx(truth.duration_s, abs=0.1)
    standing = truth.changes[8].end_s - truth.changes[0].start_s
    assert got["five_sit_to_stand_standing_s"] == pytest.approx(standing, abs=0.1)
    assert [s.name for s in chair_rises.segments] == ["sit_to_stand", "stand_to_sit"] * 5
    assert got["chair_rise_count"] == 5.0
    one = np.mean([c.end_s - c.start_s for c in truth.changes[::2]])
    assert got["chair_rise_s"] == pytest.approx(one, abs=0.1)
    assert got["chair_rise_slowing_pct"] == pytest.approx(0.0, abs=5.0)


def test_three_rises_are_too_few_and_six_are_told() -> None:
    few = measure_chair_rises(follow_trunk(wear(rises("healthy", 3)[0], "pelvis")))
    assert reasons(few) == {"too_few_rises"}
    assert len(few.segments) == 6
    many = measure_chair_rises(follow_trunk(wear(rises("healthy", 6)[0], "pelvis")))
    assert means(many)["chair_rise_count"] == 5.0
    assert [n.code for n in many.notices] == ["more_rises"]


def test_the_trunk_needs_a_sensor_and_a_rest() -> None:
    take = tug()[0]
    with pytest.raises(EstimationError, match="pelvis or chest"):
        follow_trunk(replace(take, sensors={}))
    start = 700
    cut = take.sensors["pelvis"]
    walk = slice(start, start + 300)
    part = replace(
        cut,
        acc=cut.acc[walk],
        gyr=cut.gyr[walk],
        mag=None,
        valid=cut.valid[walk],
        interpolated=cut.interpolated[walk],
    )
    with pytest.raises(EstimationError, match="never still"):
        follow_trunk(replace(take, t_s=take.t_s[:300], sensors={"pelvis": part}))


def test_a_recording_carries_what_a_person_said() -> None:
    assert Recording({}, {}).test_limits == GivenLimits()
