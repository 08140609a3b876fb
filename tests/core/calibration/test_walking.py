"""Walking, straight walking, and rotation of a sensor."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.calibration.walking import (
    WalkingParams,
    mean_turn,
    measure_turned_angle,
    moving_mask,
    straight_parts,
    turn_sensors,
    turning_mask,
)
from sagittal.core.frames import GRAVITY, Bools, Floats, Segment
from sagittal.core.rotation import about, exp, multiply
from sagittal.core.signals.recording import SensorSignals, Subject, UniformRecording

RATE = 50.0
N = 1000
T = np.arange(N) / RATE
PARAMS = WalkingParams()
WALKS = (T >= 5.0) & (T < 15.0)


def sensor(gyr: Floats | None = None, acc: Floats | None = None, valid: Bools | None = None) -> SensorSignals:
    still = np.tile([0.0, 0.0, GRAVITY], (N, 1))
    target = np.ones(N, np.bool_) if valid is None else valid
    return SensorSignals(
        "", still if acc is None else acc, np.zeros((N, 3)) if gyr is None else gyr, None, target, ~target
    )


def worn(**sensors: SensorSignals) -> UniformRecording:
    inputs: dict[Segment, SensorSignals] = sensors  # type: ignore[assignment]
    return UniformRecording(T, RATE, inputs, Subject(), "walk", {})


def edges(mask: Bools) -> list[float]:
    return [float(t) for t in T[1:][mask[1:] != mask[:-1]]]


def test_legs_that_turn_on_the_average_walk() -> None:
    turns = WALKS[:, None] * np.array([0.0, 1.2, 0.0])
    inputs = worn(shank_l=sensor(turns), foot_l=sensor())
    assert edges(moving_mask(inputs, PARAMS)) == pytest.approx([5.0, 15.0], abs=0.5)
    slower = worn(shank_l=sensor(0.8 * turns), foot_l=sensor())
    assert not moving_mask(slower, PARAMS).any()


def test_without_legs_the_trunk_tells_by_how_its_force_varies() -> None:
    sway = (WALKS * np.sin(2.0 * np.pi * 2.0 * T))[:, None] * np.array([0.0, 0.0, 1.0])
    upright = np.array([0.0, 0.0, GRAVITY])
    walks = worn(pelvis=sensor(acc=upright + 0.6 * sway))
    assert edges(moving_mask(walks, PARAMS)) == pytest.approx([5.0, 15.0], abs=0.6)
    assert not moving_mask(worn(pelvis=sensor(acc=upright + 0.4 * sway)), PARAMS).any()
    legs = worn(pelvis=sensor(acc=upright + 6.0 * sway), thigh_l=sensor())
    assert not moving_mask(legs, PARAMS).any(), "where legs are worn they decide"


def yawing(rate_deg: float) -> SensorSignals:
    """A sensor lying on its side that turns about the vertical from 8 to 10 s."""
    gyr = np.zeros((N, 3))
    gyr[(T >= 8.0) & (T < 10.0), 0] = np.radians(rate_deg)
    return sensor(gyr + np.array([0.0, 0.1, 0.0]))


LAID = np.tile(about(1, -0.5 * np.pi), (N, 1))
"""x of the sensor points up."""
BIAS = np.array([0.0, 0.1, 0.0])


def turning(rate_deg: float, *segments: Segment) -> list[float]:
    inputs = worn(**{s: yawing(rate_deg) for s in segments})
    mask = turning_mask(inputs, dict.fromkeys(segments, BIAS), dict.fromkeys(segments, LAID), PARAMS)
    return edges(mask)


@pytest.mark.parametrize("rate_deg", [60.0, -60.0])
def test_a_turn_is_found_with_its_margin_whichever_way(rate_deg: float) -> None:
    assert turning(rate_deg, "pelvis") == pytest.approx([8.0 - 0.15, 10.0 + 0.15], abs=0.15)


def test_a_slow_change_of_heading_is_no_turn() -> None:
    assert turning(25.0, "pelvis") == []


def test_legs_are_looked_at_more_slowly() -> None:
    brief = np.zeros((N, 3))
    brief[(T >= 8.0) & (T < 8.6), 0] = np.radians(60.0)
    q = {"pelvis": LAID, "foot_l": LAID}
    none = {"pelvis": np.zeros(3), "foot_l": np.zeros(3)}
    assert turning_mask(worn(pelvis=sensor(brief)), none, q, PARAMS).any()  # type: ignore[arg-type]
    assert not turning_mask(worn(foot_l=sensor(brief)), none, q, PARAMS).any()  # type: ignore[arg-type]


def test_the_steadiest_sensors_that_were_never_lost_show_turns() -> None:
    lost = np.ones(N, np.bool_)
    lost[100:106] = False
    brief = np.ones(N, np.bool_)
    brief[100:105] = False
    assert turn_sensors(worn(pelvis=sensor(), chest=sensor(), thigh_l=sensor())) == ["pelvis", "chest"]
    assert turn_sensors(worn(pelvis=sensor(valid=lost), chest=sensor())) == ["chest"]
    assert turn_sensors(worn(pelvis=sensor(valid=lost), foot_l=sensor())) == ["foot_l"]
    assert turn_sensors(worn(pelvis=sensor(valid=brief), foot_l=sensor())) == ["pelvis"]
    assert turn_sensors(worn(shank_l=sensor(valid=lost), foot_l=sensor(valid=lost))) == ["shank_l"]
    assert turn_sensors(worn()) == []


def test_straight_parts_are_long_enough_and_without_turns() -> None:
    moving, turn = np.ones(400, np.bool_), np.zeros(400, np.bool_)
    moving[:50] = turn[125:130] = turn[204:250] = False
    turn[125:130] = turn[204:250] = True
    assert straight_parts(moving, turn, RATE, PARAMS) == [(50, 125), (250, 400)]
    assert straight_parts(~moving, turn, RATE, PARAMS) == []


def test_a_turn_is_measured_about_the_vertical_whatever_the_mounting() -> None:
    remainder = exp(np.array([0.4, -0.7, 0.2]))
    turned = multiply(about(2, np.array([0.0, 0.5, -3.0, 3.3])), remainder)
    assert measure_turned_angle(turned, remainder) == pytest.approx([0.0, 0.5, -3.0, 3.3 - 2.0 * np.pi])
    assert measure_turned_angle(-turned, remainder) == pytest.approx([0.0, 0.5, -3.0, 3.3 - 2.0 * np.pi])


def test_the_mean_turn_is_that_on_a_circle() -> None:
    remainder = about(0, 0.3)
    turned = multiply(about(2, np.radians([90.0, 170.0, -170.0, 10.0])), remainder)
    assert abs(mean_turn(turned, remainder, (1, 3))) == pytest.approx(np.pi)
    assert mean_turn(turned, remainder, (0, 1)) == pytest.approx(0.5 * np.pi)
