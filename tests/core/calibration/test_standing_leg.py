"""Which leg carries: against the true height of the feet."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.calibration.fixed_offset import make_fixed_mounts
from sagittal.core.calibration.known_mounts import FIXED_OFFSET, calibrate_with_mounts
from sagittal.core.calibration.standing_leg import find_standing_legs
from sagittal.core.frames import FOOT, SIDES, Segment
from sagittal.core.rotation import about, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.simulate import SquatSimulation, simulate_movement
from sagittal.core.timeline import synchronise


@cache
def recorded(name: str) -> tuple[SquatSimulation, CalibratedRecording]:
    simulation = simulate_movement(name, 1)
    assert isinstance(simulation, SquatSimulation)
    mounts = make_fixed_mounts(*SIDES)
    return simulation, calibrate_with_mounts(
        synchronise(simulation.recording), mounts, "fixed_offset", FIXED_OFFSET
    )


def test_a_lifted_foot_does_not_stand() -> None:
    recording, calibrated = recorded("squats_both_legs")
    stands = find_standing_legs(calibrated)
    for side in SIDES:
        height = recording.truth.p[FOOT[side]][:, 2]
        height = height[: len(stands[side])] - height[0]
        assert stands[side][height < 0.01].all()
        assert not stands[side][height > 0.09].any()
    assert (stands["left"] | stands["right"]).all()


def test_on_both_feet_both_stand() -> None:
    assert all(s.all() for s in find_standing_legs(recorded("squats_together")[1]).values())


@pytest.mark.parametrize(("segment", "axis", "deg"), [("shank_l", 1, 60.0), ("pelvis", 0, 12.0)])
def test_a_sensor_turned_about_its_bone_or_tilted_on_the_back_changes_nothing(
    segment: Segment, axis: int, deg: float
) -> None:
    _, calibrated = recorded("squats_both_legs")
    segments = dict(calibrated.calibration.segments)
    turned = to_matrix(about(axis, np.radians(deg))) @ segments[segment].R_segment_sensor
    segments[segment] = replace(segments[segment], R_segment_sensor=turned)
    off = replace(calibrated, calibration=replace(calibrated.calibration, segments=segments))
    for side, stands in find_standing_legs(off).items():
        assert np.mean(stands == find_standing_legs(calibrated)[side]) > 0.99


def test_a_leg_alone_is_taken_to_stand() -> None:
    _, calibrated = recorded("squats_both_legs")
    segments = {s: x for s, x in calibrated.calibration.segments.items() if not s.endswith("_l")}
    single_variant = replace(calibrated, calibration=replace(calibrated.calibration, segments=segments))
    assert set(find_standing_legs(single_variant)) == {"right"}
    assert find_standing_legs(single_variant)["right"].all()
