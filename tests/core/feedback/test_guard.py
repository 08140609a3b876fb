"""The guard detects changes of other parameters and names its limit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from sagittal.core.feedback import Baseline, FeedbackEngine
from sagittal.core.feedback.guard import FIRST, LAST
from sagittal.core.frames import Floats
from sagittal.core.norms.adults import adult_reference
from sagittal.core.norms.profile import SAGITTAL
from tests.helpers.feedback import OPEN, prescription, walked


def curves(added_deg: float = 0.0) -> Mapping[str, Floats]:
    """Curves of healthy adults, the knee's with a wave more."""
    result = {v: np.radians(adult_reference().mean_deg[v]) for v in SAGITTAL}
    wave = np.sqrt(2.0) * np.cos(np.linspace(0.0, 2.0 * np.pi, 101)[:-1])
    result["knee_flexion"] = result["knee_flexion"] + np.radians(added_deg * np.append(wave, wave[0]))
    return result


def walk(
    second: list[float], gps: list[float] | None = None, baseline: Baseline = OPEN, **changes: Any
) -> FeedbackEngine:
    """Left and right in turn; the right, untrained one has these values."""
    engine = FeedbackEngine(prescription(**changes), baseline)
    for i, value in enumerate(second):
        shape = {} if gps is None else curves(gps[i])
        engine.push(walked(2 * i, 0.4, curves=shape))
        engine.push(walked(2 * i + 1, value, "right", curves=shape))
    return engine


def test_a_change_of_the_other_side_beyond_its_mdc_is_watched_with_its_source() -> None:
    reference = Baseline(0.4, 0.03, 40, "before", other_mdc=0.067, other_mdc_source="Kesar et al. 2011")
    calm = walk([0.60] * FIRST + [0.55] * LAST, baseline=reference).state.guard
    assert calm.other.change == pytest.approx(-0.05)
    assert (calm.other.limit, calm.other.source) == (0.067, "Kesar et al. 2011")
    assert (calm.other.beyond, calm.state) == (False, "ok")
    worse = walk([0.60] * FIRST + [0.52] * LAST, baseline=reference).state.guard
    assert (worse.other.beyond, worse.state) == (True, "watch")


def test_without_an_mdc_two_sd_of_the_first_strides_are_the_limit() -> None:
    first = [0.58, 0.62] * (FIRST // 2)
    result = walk(first + [0.56] * LAST).state.guard.other
    assert result.limit == pytest.approx(2.0 * float(np.std(first, ddof=1)))
    assert result.source == "2 SD of the first 10 strides"
    assert not result.beyond
    assert walk(first + [0.50] * LAST, guard={"other_change": 0.2}).state.guard.other.limit == 0.2


def test_a_rise_of_the_sagittal_profile_is_watched_and_stops_at_the_stop_rule() -> None:
    # a wave of x degrees RMS in one of three variables of both sides is a profile of x / √3
    rise = [0.0] * FIRST + [3.0] * LAST
    engine = walk([0.6] * len(rise), rise)
    gps = engine.state.guard.gps
    assert gps.change == pytest.approx(3.0 / np.sqrt(3.0), rel=0.02)
    assert (gps.limit, gps.beyond) == (1.6, True)
    assert engine.state.stopped is None
    stopping = walk([0.6] * len(rise), rise, stop_rule={"gps_rise_deg": 1.7})
    assert stopping.state.stopped == "gps_rise"


def test_before_enough_strides_nothing_is_judged() -> None:
    guard = walk([0.6] * (2 * FIRST - 1), [0.0] * (2 * FIRST - 1)).state.guard
    assert (guard.other.reason, guard.gps.reason) == ("too_few_strides", "too_few_strides")
    assert guard.state == "unknown"


def test_what_cannot_be_judged_says_why() -> None:
    guard = walk([0.6] * 40).state.guard
    assert guard.gps.reason == "joint_missing"
    assert walk([0.6] * 40, side=None).state.guard.other.reason == "both_sides_trained"
    unlimited = walk([0.6] * 40, [0.0] * 40, guard={"gps_rise_deg": None}).state.guard.gps
    assert unlimited.change == pytest.approx(0.0, abs=1e-9)
    assert unlimited.reason == "no_limit"
