"""Which direction of a walk is taken, and what of the others is kept."""

from __future__ import annotations

from math import radians

import pytest

from sagittal.core.calibration.heading import WalkingDirection
from sagittal.core.calibration.ways import SignedWays, choose_way

STRIDES = WalkingDirection(radians(3.0), 0.9, 1.2)
VELOCITY = WalkingDirection(radians(20.0), 0.8, 1.1)
START = WalkingDirection(radians(40.0), 0.7, 0.8)
CLEAR, WEAK = WalkingDirection(radians(180.0), 0.9), WalkingDirection(radians(180.0), 0.3)


def test_strides_go_before_the_axis_however_clear_that_is() -> None:
    way = choose_way(SignedWays(strides=STRIDES, velocity=VELOCITY), CLEAR)
    assert way is not None
    assert way.chosen is STRIDES
    assert way.off == pytest.approx(radians(-3.0))


@pytest.mark.parametrize(
    ("ways", "axis", "source", "deg"),
    [
        (SignedWays(velocity=VELOCITY), CLEAR, "acceleration", 0.0),
        (SignedWays(velocity=VELOCITY), WEAK, "velocity", 20.0),
        (SignedWays(start=START), CLEAR, "acceleration", 0.0),
        (SignedWays(start=START), WEAK, "velocity", 40.0),
    ],
)
def test_a_clear_axis_goes_before_a_velocity_that_gives_it_its_sign(
    ways: SignedWays, axis: WalkingDirection, source: str, deg: float
) -> None:
    way = choose_way(ways, axis)
    assert way is not None
    assert way.facts["source"] == source
    assert way.chosen.angle == pytest.approx(radians(deg), abs=1e-12)


def test_an_axis_alone_has_no_sign() -> None:
    assert choose_way(SignedWays(), CLEAR) is None
