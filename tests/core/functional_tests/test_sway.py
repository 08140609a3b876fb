"""Sway of a pendulum that goes round an ellipse: every figure has a closed form."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import pytest

from sagittal.core.frames import Segment
from sagittal.core.functional_tests.result import FunctionalTest
from sagittal.core.functional_tests.sway import measure_sway
from sagittal.core.signals.recording import GivenLimits
from sagittal.core.simulate import RecordingSetup
from sagittal.core.simulate.mems import MEMS
from sagittal.core.simulate.standing import Sway, SwaySimulation, simulate_sway
from sagittal.core.timeline import synchronise

QUIET = RecordingSetup(noise=None)


def measure(
    result: SwaySimulation, segment: Segment = "pelvis", limits: GivenLimits | None = None
) -> FunctionalTest:
    take = synchronise(result.recording)
    return measure_sway(replace(take, sensors={segment: take.sensors[segment]}), limits)


def means(test: FunctionalTest) -> dict[str, float | None]:
    return {p.name: p.mean for p in test.parameters}


@pytest.mark.parametrize("segment", ["pelvis", "chest"])
@pytest.mark.parametrize(("setup", "within"), [(QUIET, 0.02), (RecordingSetup(), 0.05)])
def test_figures_are_those_of_the_pendulum(segment: Segment, setup: RecordingSetup, within: float) -> None:
    sway = simulate_sway(seed=3, setup=setup)
    truth, got = sway.truth[segment], means(measure(sway, segment))
    seconds = got["sway_duration_s"]
    assert seconds == pytest.approx(40.0, abs=1.0)
    assert seconds is not None
    assert got["sway_rms_mps2"] == pytest.approx(truth.rms, rel=within)
    assert got["sway_area_m2ps4"] == pytest.approx(truth.area, rel=2.0 * within)
    assert got["sway_jerk_m2ps5"] == pytest.approx(truth.jerk * seconds / 40.0, rel=2.0 * within + 0.03)
    assert got["sway_centroid_frequency_hz"] == pytest.approx(0.5, rel=within + 0.02)


def test_a_circle_has_its_path_velocity_and_frequency() -> None:
    sway = simulate_sway(Sway(0.006, 0.006, 0.8), setup=QUIET)
    radius, got = sway.truth["pelvis"].forward, means(measure(sway))
    seconds = got["sway_duration_s"]
    assert seconds is not None
    assert got["sway_path_mps2"] == pytest.approx(2.0 * pi * radius * 0.8 * seconds, rel=0.02)
    assert got["sway_mean_frequency_hz"] == pytest.approx(0.8, rel=0.02)
    assert got["sway_velocity_mps"] == pytest.approx(radius / (2.0 * pi * 0.8), rel=0.05)


def test_twice_the_sway_has_twice_the_size_and_four_times_the_area() -> None:
    one, two = (means(measure(simulate_sway(Sway(k * 0.005, k * 0.003), setup=QUIET))) for k in (1.0, 2.0))
    assert one["sway_rms_mps2"] is not None
    assert one["sway_area_m2ps4"] is not None
    assert two["sway_rms_mps2"] == pytest.approx(2.0 * one["sway_rms_mps2"], rel=0.01)
    assert two["sway_area_m2ps4"] == pytest.approx(4.0 * one["sway_area_m2ps4"], rel=0.01)
    assert two["sway_mean_frequency_hz"] == pytest.approx(one["sway_mean_frequency_hz"], rel=0.01)


def test_a_short_standing_is_withheld() -> None:
    measurement = measure(simulate_sway(Sway(duration_s=15.0), setup=QUIET))
    assert {p.reason for p in measurement.parameters} == {"standing_too_short"}
    assert measurement.segments == ()


def test_a_person_chooses_the_part() -> None:
    measurement = measure(simulate_sway(setup=QUIET), limits=GivenLimits(5.0, 30.0))
    assert (measurement.start_s, measurement.end_s, measurement.corrected) == (5.0, 30.0, True)


def test_noise_of_the_sensor_is_no_sway() -> None:
    still = Sway(0.0003, 0.0003, 0.5)
    loud = simulate_sway(still, setup=RecordingSetup(noise=MEMS.times(10.0)))
    measurement = measure(loud)
    withheld = {p.name for p in measurement.parameters if p.reason == "noise_dominated"}
    assert {"sway_jerk_m2ps5", "sway_path_mps2", "sway_mean_frequency_hz"} <= withheld
    quiet = measure(simulate_sway(still, setup=QUIET))
    assert {p.reason for p in quiet.parameters} == {None}
