"""A wrong rate contradicts gravity; a right one, a treadmill and feet that disagree do not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.agreement.stride_gravity import cut_strides, measure_stride_gravity
from sagittal.core.consistency.doubt import RATE
from sagittal.core.consistency.rate import judge_rate, measure_rate
from sagittal.core.signals.recording import UniformRecording
from tests.helpers.walks import only, simulated


@cache
def feet() -> UniformRecording:
    return only(simulated("comfortable", 1)[0], "foot_l", "foot_r")


def declare(rate_hz: float) -> UniformRecording:
    """The same samples with another rate."""
    return replace(feet(), t_s=feet().t_s * feet().rate_hz / rate_hz, rate_hz=rate_hz)


@pytest.mark.parametrize("rate_hz", [95.0, 105.0])
def test_a_rate_five_percent_off_is_doubted(rate_hz: float) -> None:
    doubt = judge_rate(declare(rate_hz), treadmill=False)
    assert doubt is not None
    assert (doubt.notice.code, doubt.scope) == (RATE, "none")
    assert judge_rate(declare(rate_hz), treadmill=True) is None


def test_the_right_rate_is_not() -> None:
    assert judge_rate(feet(), treadmill=False) is None


def test_the_factor_is_that_of_the_rate() -> None:
    for rate_hz in (96.0, 100.0, 104.0):
        walk = declare(rate_hz)
        foot, borders = walk.sensors["foot_l"], cut_strides(walk)["foot_l"]
        strides = measure_stride_gravity("foot_l", foot, borders, rate_hz)
        flats = np.round(strides.at_s * rate_hz).astype(np.int64)
        found = measure_rate(foot, flats, rate_hz)
        assert found is not None
        assert found.factor == pytest.approx(rate_hz / 100.0, abs=0.008)
        assert measure_rate(foot, flats[:8], rate_hz) is None


def test_one_foot_alone_or_feet_that_disagree_say_nothing() -> None:
    assert judge_rate(only(declare(105.0), "foot_l"), treadmill=False) is None
    x = feet().sensors["foot_l"]
    scaled = replace(feet(), sensors={**feet().sensors, "foot_l": replace(x, gyr=1.05 * x.gyr)})
    assert judge_rate(scaled, treadmill=False) is None
