"""Sensors named in the notice on corrected relative headings."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from sagittal.core.calibration import calibrate
from sagittal.core.frames import Segment
from sagittal.core.fusion.drift import DriftParams, remove_relative_drift
from sagittal.core.rotation import about, exp, multiply
from tests.helpers.walks import simulated


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 6, 10, 11])
def test_of_two_feet_alone_the_last_digits_do_not_choose(seed: int) -> None:
    """Their reference is half way between them, so that both turn from it by the same angle."""
    rate_hz, n = 50.0, 6000
    calibration = calibrate(simulated("comfortable", 2)[0]).calibration
    walk = replace(calibration, walking=((0.0, n / rate_hz),))
    rng, turn = np.random.default_rng(seed), np.linspace(0.0, radians(10.0), n)
    feet: tuple[Segment, Segment] = ("foot_l", "foot_r")
    headings = about(2, turn + rng.uniform(-3.0, 3.0)), about(2, -turn)
    q = {foot: multiply(x, exp(rng.normal(0.0, 0.1, (n, 3)))) for foot, x in zip(feet, headings, strict=True)}
    valid = dict.fromkeys(feet, np.ones(n, np.bool_))
    _, largest, (notice,) = remove_relative_drift(q, valid, walk, rate_hz, DriftParams())
    assert largest["foot_l"] == pytest.approx(largest["foot_r"], rel=1e-9)
    assert notice.sensor == "foot_l"
