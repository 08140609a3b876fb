"""Forward axes by likelihood: what follows from the sum, on measures made up for it."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians

import numpy as np
import pytest

from sagittal.core.calibration.forward import (
    ForwardMeasure,
    ForwardParams,
    JointMeasure,
    MeasureName,
    weigh_forward_axes,
)
from sagittal.core.frames import THIGH, Segment
from sagittal.core.rotation import wrap_angle

P = ForwardParams()


def says(source: MeasureName, degrees: float, sd: float = 4.0, doubt: float = 0.1) -> ForwardMeasure:
    return ForwardMeasure(source, float(wrap_angle(radians(degrees))), radians(sd), doubt)


@pytest.mark.parametrize("turn", [0.0, 120.3, 178.0, -179.6])
def test_two_measures_that_agree_are_averaged_by_their_precision(turn: float) -> None:
    pair = (says("velocity", turn, sd=3.0), says("acceleration", turn + 6.0, sd=6.0))
    forward_axes = weigh_forward_axes({"pelvis": pair}, [], {})["pelvis"]
    # weights 1/9 and 1/36
    assert np.degrees(wrap_angle(forward_axes.angle - radians(turn))) == pytest.approx(1.2, abs=0.1)
    assert np.degrees(forward_axes.sd) == pytest.approx((1 / 9 + 1 / 36) ** -0.5, rel=0.1)
    assert all(v.share > 0.9 for v in forward_axes.votes)


def test_the_one_that_nobody_agrees_with_is_left_out() -> None:
    three = (says("velocity", 10.0), says("gyro_pca", 12.0), says("acceleration", 80.0))
    forward_axes = weigh_forward_axes({"thigh_l": three}, [], {})["thigh_l"]
    assert np.degrees(forward_axes.angle) == pytest.approx(11.0, abs=0.3)
    assert [v.share > 0.2 for v in forward_axes.votes] == [True, True, False]


def test_a_draw_is_uncertain() -> None:
    forward_axes = weigh_forward_axes({"pelvis": (says("velocity", 0.0), says("acceleration", 40.0))}, [], {})
    assert np.degrees(forward_axes["pelvis"].sd) > np.degrees(P.tell_sd)


def test_neighbours_decide_between_two() -> None:
    torn = (says("velocity", 0.0), says("acceleration", 25.0))
    sure = (says("strides", 30.0, 2.0, 0.02),)
    joints = (
        JointMeasure("thigh_r", "shank_r", radians(-50.0), radians(4.0), 0.05),
        JointMeasure("shank_r", "foot_r", radians(20.0), radians(3.0), 0.05),
    )
    forward_axes = weigh_forward_axes({"thigh_r": torn, "shank_r": torn[:0], "foot_r": sure}, joints, {})
    assert np.degrees(forward_axes["shank_r"].angle) == pytest.approx(50.0, abs=1.0)
    assert np.degrees(forward_axes["thigh_r"].angle) == pytest.approx(0.0, abs=1.0)
    shares = {v.source: v.share for v in forward_axes["thigh_r"].votes}
    assert shares["velocity"] > 0.9
    assert shares["acceleration"] < 0.2


def test_the_pelvis_hears_both_legs() -> None:
    """As a normal product has it: each leg's measures at the end of a chain of spreads."""
    measures: dict[Segment, Sequence[ForwardMeasure]] = {
        "pelvis": (),
        "thigh_l": (says("velocity", 4.0, 3.0, 0.0),), "thigh_r": (says("velocity", -2.0, 3.0, 0.0),),
    }  # fmt: skip
    joints = [JointMeasure("pelvis", s, 0.0, radians(4.0), 0.0) for s in THIGH.values()]
    forward_axes = weigh_forward_axes(measures, joints, {})
    assert np.degrees(forward_axes["pelvis"].angle) == pytest.approx(1.0, abs=0.05)
    assert np.degrees(forward_axes["pelvis"].sd) == pytest.approx(5.0 / np.sqrt(2.0), rel=0.03)


def test_left_mirrors_right() -> None:
    sides: tuple[tuple[Segment, float], ...] = (("shank_l", -12.0), ("shank_r", 12.0))
    axes = {s: says("mirror", a, 5.0) for s, a in sides}
    sure, open_ = (says("velocity", 0.0, 2.0, 0.0),), (says("velocity", -20.0, 20.0, 0.0),)
    forward_axes = weigh_forward_axes({"shank_l": open_, "shank_r": sure}, [], axes)
    assert np.degrees(forward_axes["shank_l"].angle) == pytest.approx(0.0, abs=2.5)


def test_a_sensor_without_a_joint_to_the_others_is_heard_alone() -> None:
    pair = (says("velocity", 30.0, sd=3.0), says("acceleration", 36.0, sd=6.0))
    single_axes = weigh_forward_axes({"pelvis": pair}, [], {})["pelvis"]
    joint_axes = weigh_forward_axes({"chest": pair, "pelvis": (says("velocity", 0.0),)}, [], {})
    assert joint_axes["chest"].angle == pytest.approx(single_axes.angle)
    assert joint_axes["chest"].sd == pytest.approx(single_axes.sd)
    assert joint_axes["pelvis"].angle == pytest.approx(0.0, abs=0.01)
