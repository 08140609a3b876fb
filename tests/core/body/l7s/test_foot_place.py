"""The place of a foot's sensor from how the foot rolls over its ball."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.body.l7s.filter import L7sInputs
from sagittal.core.body.l7s.foot_place import find_sensor_offsets
from sagittal.core.body.l7s.inputs import free_acceleration, take_of
from sagittal.core.body.l7s.legs import LEGS, LegModel
from sagittal.core.body.model import BodyModel
from sagittal.core.calibration import calibrate
from sagittal.core.frames import FOOT, Floats
from sagittal.core.fusion.mahony import estimate_orientations
from tests.helpers.l7s_walks import steps_of
from tests.helpers.walks import simulated

RATE = 100.0
MODEL = LegModel.of(BodyModel.from_height(1.7))
SENSOR = np.array([0.02, 0.0, 0.11])
"""Of the feet here, from the middle: 2 cm under it and 11 cm in front, in Sy's axes."""


def rolling(rise_deg: float, strides: int = 4, ahead: Floats = SENSOR) -> L7sInputs:
    """Feet whose heels rise and fall about a ball that never leaves the floor, resting in between."""
    buffer, roll = np.zeros(60), np.radians(rise_deg) * np.sin(np.linspace(0.0, np.pi, 61)) ** 4
    rise = np.concatenate([np.concatenate((buffer, roll)) for _ in range(strides)] + [buffer])
    still = np.concatenate([np.repeat((True, False), (60, 61)) for _ in range(strides)] + [np.ones(60, bool)])
    n = len(rise)
    # Sy's foot: z forward, y left, x down; the heel rises about y
    c, s, one = np.cos(rise), np.sin(rise), np.ones(n)
    z = np.stack((c, 0 * one, -s), axis=-1)
    y = np.stack((0 * one, one, 0 * one), axis=-1)
    R = np.zeros((n, 3, 3, 3))
    R[:] = np.stack((np.cross(y, z), y, z), axis=-1)[:, None]
    p = R[:, 1] @ (ahead - [0.0, 0.0, 0.5 * MODEL.foot])
    acc = np.zeros((n, 3, 3))
    acc[:, 1:] = np.gradient(np.gradient(p, 1.0 / RATE, axis=0), 1.0 / RATE, axis=0)[:, None]
    return L7sInputs(R, acc, np.stack((still, still), axis=1), "2I")


def find(inputs: L7sInputs) -> Floats:
    return find_sensor_offsets(inputs, np.ones((len(inputs.acc), 3), bool), MODEL, RATE)


def test_a_foot_that_rolls_over_its_ball_tells_where_its_sensor_sits() -> None:
    np.testing.assert_allclose(find(rolling(40.0)), [-SENSOR, -SENSOR], atol=0.002)


@pytest.mark.parametrize(
    ("inputs", "why"),
    [
        (rolling(4.0), "the heel hardly rises"),
        (rolling(40.0, strides=2), "too few strides"),
        (rolling(40.0, ahead=np.array([0.0, 0.0, -0.3])), "no such place on a foot"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_a_foot_that_tells_nothing_is_taken_as_the_paper_does(inputs: L7sInputs, why: str) -> None:
    assert (find(inputs) == 0.0).all(), why


def test_a_lost_push_off_is_left_out() -> None:
    inputs = rolling(40.0)
    acc = inputs.acc.copy()
    acc[60:121, 1] = 50.0
    valid = np.ones((len(acc), 3), bool)
    valid[70:80, 1] = False
    sensor_offsets = find_sensor_offsets(replace(inputs, acc=acc), valid, MODEL, RATE)
    np.testing.assert_allclose(sensor_offsets, [-SENSOR, -SENSOR], atol=0.002)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["comfortable", "hemiparetic"])
def test_simulated_feet_have_their_sensors_where_they_are_found(name: str) -> None:
    recording, truth = simulated(name, 0)
    calibrated = calibrate(recording)
    orientations = estimate_orientations(calibrated)
    model = LegModel.of(truth.body)
    inputs = take_of(
        orientations, free_acceleration(calibrated, orientations), steps_of(calibrated), model, "2I"
    )
    sensor_offsets = find_sensor_offsets(inputs, np.ones((len(inputs.step), 3), bool), model, RATE)
    for leg, side in enumerate(LEGS):
        x, y, _ = truth.mounts[FOOT[side]].position_m
        c, s = np.cos(model.incline), np.sin(model.incline)
        # from the ankle along and across the line to the ball, less half of it
        along, down = c * x - s * y - 0.5 * model.foot, -s * x - c * y
        assert -sensor_offsets[leg, 2] == pytest.approx(along, abs=0.02)
        assert -sensor_offsets[leg, 0] == pytest.approx(down, abs=0.02)
