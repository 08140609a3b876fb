"""Heading difference of adjacent sensors from their joint."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core.calibration.joint_turns import JointTurnParams, measure_joint_turns
from sagittal.core.frames import Floats, Segment
from sagittal.core.rotation import about, multiply, wrap_angle
from sagittal.core.signals.recording import UniformRecording
from tests.helpers.walks import only, simulated

WALK: tuple[int, int] = (700, 1500)
"""Samples of straight walking."""
PARAMS = JointTurnParams()


@cache
def take() -> tuple[UniformRecording, dict[Segment, Floats]]:
    """Shank and foot, and sensor to world of each."""
    recording, truth = simulated("comfortable", 1)
    segments: tuple[Segment, ...] = ("shank_l", "foot_l")
    return only(recording, *segments), {
        s: multiply(truth.q[s], truth.mounts[s].q_segment_sensor)[: len(recording.t_s)] for s in segments
    }


def measure(
    turned_deg: float = 0.0, parts: tuple[tuple[int, int], ...] = (WALK,)
) -> list[tuple[float, float]]:
    """Turns found and their sd, degrees, where the world of the foot is turned."""
    recording, q = take()
    inputs = {**q, "foot_l": multiply(about(2, np.radians(turned_deg)), q["foot_l"])}
    joint_turns = measure_joint_turns(recording, {s: np.zeros(3) for s in q}, inputs, parts, PARAMS)
    assert all((x.proximal, x.distal, x.doubt) == ("shank_l", "foot_l", PARAMS.doubt) for x in joint_turns)
    return [(float(np.degrees(x.turn)), float(np.degrees(x.sd))) for x in joint_turns]


def test_the_turn_between_two_worlds_is_found_with_its_sign() -> None:
    ((straight, sd),) = measure()
    assert straight == pytest.approx(0.0, abs=3.0)
    assert 3.0 <= sd < 5.0
    ((turned, _),) = measure(40.0)
    assert wrap_angle(np.radians(turned - straight)) == pytest.approx(np.radians(-40.0), abs=1e-3)
    ((back, _),) = measure(170.0)
    assert wrap_angle(np.radians(back - straight + 170.0)) == pytest.approx(0.0, abs=1e-3)


def test_without_enough_walking_a_joint_says_nothing() -> None:
    assert measure(parts=()) == []
    assert measure(parts=((700, 750),)) == []
    assert measure(parts=((0, 300),)) == [], "who stands moves no joint"


def test_a_joint_needs_both_sensors_and_signals_that_fit() -> None:
    recording, q = take()
    biases = {s: np.zeros(3) for s in q}
    single_by_segment: dict[Segment, Floats] = {"foot_l": q["foot_l"]}
    assert measure_joint_turns(recording, biases, single_by_segment, [WALK], PARAMS) == []
    strict = JointTurnParams(worst_misfit=0.01)
    assert measure_joint_turns(recording, biases, q, [WALK], strict) == []
