"""Wrong set-ups are detected, and the proposed correction restores the recording."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY, Segment
from sagittal.core.pipeline import PipelineConfig, analyse
from sagittal.core.setup import SetupParams, SetupRepair
from sagittal.core.signals.correction import SensorCorrection
from sagittal.core.signals.recording import Recording
from sagittal.core.simulate import simulate_scenario
from tests.helpers.setup_mistakes import TURNS, apply_repair, change_axes, exchange_labels, look_at

LEFT_HANDED = np.diag([-1.0, 1.0, 1.0])


@cache
def take() -> Recording:
    """Seven sensors of a person with different left and right legs."""
    return simulate_scenario("hemiparetic", seed=5).recording


def change_all(acc: object, gyr: object) -> Recording:
    result = take()
    for segment in take().segments.values():
        if segment is not None:
            result = change_axes(result, segment, acc, gyr)  # type: ignore[arg-type]
    return result


def require(recording: Recording) -> SetupRepair:
    repair, _ = look_at(recording)
    assert repair is not None
    return repair


@pytest.mark.sweep
def test_nothing_is_said_of_a_right_set_up_however_sensors_are_turned() -> None:
    recording = take()
    for k, segment in enumerate(s for s in take().segments.values() if s is not None):
        turn = TURNS[(5 * k + 3) % len(TURNS)]
        recording = change_axes(recording, segment, turn, turn)
    repair, exchange = look_at(recording)
    assert repair is None
    assert exchange is not None
    assert exchange.swap == ()


@pytest.mark.sweep
@pytest.mark.parametrize("segment", ["thigh_l", "shank_r"])
@pytest.mark.parametrize(
    ("acc", "gyr"), [(LEFT_HANDED, LEFT_HANDED), (1.0, -1.0), (-1.0, 1.0)], ids=["left-handed", "gyr", "acc"]
)
def test_one_sensor_with_wrong_signs_is_found_and_put_right(
    segment: Segment, acc: object, gyr: object
) -> None:
    wrong = change_axes(take(), segment, acc, gyr)  # type: ignore[arg-type]
    repair = require(wrong)
    assert (repair.kind, repair.is_sure) == ("axes", True)
    assert {take().segments[d] for d in repair.corrections} == {segment}
    assert look_at(apply_repair(wrong, repair))[0] is None


@pytest.mark.sweep
def test_a_file_with_left_handed_axes_is_told_from_one_with_a_turned_gyroscope() -> None:
    pair, gyroscope = require(change_all(LEFT_HANDED, LEFT_HANDED)), require(change_all(1.0, -1.0))
    against = ("-x", "-y", "-z")
    assert set(pair.corrections.values()) == {SensorCorrection(acc_axes=against, gyr_axes=against)}
    assert set(gyroscope.corrections.values()) == {SensorCorrection(gyr_axes=against)}


@pytest.mark.sweep
def test_units_are_proposed_sensor_by_sensor() -> None:
    g, deg = change_axes(take(), "shank_l", acc=1.0 / GRAVITY), change_all(1.0, np.degrees(1.0))
    result = require(g)
    assert result.kind == "units"
    assert [x.acc_times for x in result.corrections.values()] == [pytest.approx(GRAVITY)]
    assert [x.gyr_times for x in require(deg).corrections.values()] == [pytest.approx(np.radians(1.0))] * 7


@pytest.mark.sweep
@pytest.mark.parametrize(
    "names",
    [
        {"foot_l": "thigh_l", "thigh_l": "foot_l"},
        {"pelvis": "foot_r", "foot_r": "pelvis"},
        {"thigh_l": "shank_l", "shank_l": "foot_l", "foot_l": "thigh_l"},
        {"thigh_l": "foot_r", "foot_r": "shank_l", "shank_l": "pelvis", "pelvis": "thigh_l"},
    ],
)
def test_sensors_mixed_up_in_any_way_are_sorted(names: dict[Segment, Segment]) -> None:
    wrong = exchange_labels(take(), names)
    repair = require(wrong)
    assert (repair.kind, repair.is_sure) == ("labels", True)
    assert apply_repair(wrong, repair).segments == take().segments


@pytest.mark.slow
def test_exchanged_feet_are_seen_by_the_pelvis_alone() -> None:
    three = replace(
        take(),
        segments={d: s if s in ("pelvis", "foot_l", "foot_r") else None for d, s in take().segments.items()},
    )
    wrong = exchange_labels(three, {"foot_l": "foot_r", "foot_r": "foot_l"})
    assert look_at(three)[0] is None
    repair = require(wrong)
    assert not repair.is_sure
    assert apply_repair(wrong, repair).segments == three.segments


def test_feet_alone_cannot_say_whether_a_file_is_left_handed() -> None:
    feet = replace(
        change_all(LEFT_HANDED, LEFT_HANDED),
        segments={d: s if s in ("foot_l", "foot_r") else None for d, s in take().segments.items()},
    )
    repair = require(feet)
    assert not repair.can_be_applied
    assert repair.to_json()["repair"] is None


@pytest.mark.slow
def test_an_analysis_stops_at_a_wrong_set_up_unless_told_not_to() -> None:
    wrong = change_axes(take(), "foot_l", gyr=-1.0)
    analysis = analyse(wrong)
    assert analysis.problem is not None
    assert analysis.problem.code == "setup_wrong"
    assert analysis.stopped_at == "quality"
    assert analysis.setup is not None
    second_analysis = analyse(apply_repair(wrong, analysis.setup))
    assert (second_analysis.problem, second_analysis.setup) == (None, None)
    stored_analysis = analyse(wrong, PipelineConfig(setup=SetupParams(refuse=False)))
    assert stored_analysis.problem is None
    assert "setup_wrong" in {n.code for n in stored_analysis.notices}


def test_a_repair_completes_a_manifest_and_earlier_corrections() -> None:
    repair = SetupRepair("axes", (), 2.0, corrections={"A": SensorCorrection(acc_axes=("-x", "-y", "-z"))})
    initial = {"sensors": {"A": "pelvis"}, "corrections": {"a": {"acc_axes": ["-x", "y", "z"]}, "B": {}}}
    assert repair.complete_manifest(initial) == {
        "sensors": {"A": "pelvis"},
        "corrections": {"B": {}, "A": {"acc_axes": ["x", "-y", "-z"]}},
    }
    labels = SetupRepair("labels", (), 2.0, {"A": "foot_l"})
    complete_manifest = labels.complete_manifest({"sensors": {"a": "foot_r", "C": None}})
    assert complete_manifest == {"sensors": {"C": None, "A": "foot_l"}}
