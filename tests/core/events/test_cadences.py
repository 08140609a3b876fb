"""From 37 to 273 steps a minute, whole chain on simulated walks: found or refused, never silently wrong."""

from __future__ import annotations

import pytest

from sagittal.core import calibration
from sagittal.core.errors import CalibrationError
from sagittal.core.events.consensus import agree_on_contacts, all_detectors
from sagittal.core.events.lumbar import detect_steps
from sagittal.core.frames import SIDES
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate.script import Stand, Straight
from sagittal.core.simulate.truth import WalkTruth
from tests.helpers.event_scoring import match
from tests.helpers.walks import only, scripted

CADENCES = ((0.35, 0.27), (0.64, 0.27), (0.30, 0.22), (0.40, 0.90), (0.30, 1.10), (0.30, 1.30))
"""Step length in m, step time in s: twice the usual cadence, quicker still, slow, slower."""


def walk(step_m: float, step_s: float) -> tuple[UniformRecording, WalkTruth]:
    return scripted((Stand(5.0), Straight(24 * step_m, step_m, step_s), Stand(4.0)))


@pytest.mark.slow
@pytest.mark.parametrize(("step_m", "step_s"), CADENCES)
def test_the_feet_are_found_at_any_cadence(step_m: float, step_s: float) -> None:
    recording, truth = walk(step_m, step_s)
    detectors = all_detectors(estimate_orientations(calibration.calibrate(recording)))
    for events in (detectors["foot_pitch"], agree_on_contacts(detectors)):
        for side in SIDES:
            result = match(events.times(side, "ic"), truth.contacts[side].contact.tolist(), 0.15)
            # the closing step hardly lifts the foot
            assert result.missed <= 1
            assert not result.extra


@pytest.mark.slow
@pytest.mark.parametrize(("step_m", "step_s"), CADENCES)
def test_a_trunk_sensor_gives_the_cadence_or_says_why_not(step_m: float, step_s: float) -> None:
    recording, truth = walk(step_m, step_s)
    found = detect_steps(only(recording, "pelvis"))
    if not found.steps:
        assert {n.code for n in found.notices} <= {"non_periodic", "few_steps"}
        assert step_s < 0.25 or step_s > 1.2
        return
    assert found.cadence_spm == pytest.approx(60.0 / step_s, rel=0.03)
    contacts = sum(len(truth.contacts[side].contact) for side in SIDES)
    assert len(found.steps) == pytest.approx(contacts, abs=2)


@pytest.mark.slow
def test_steps_too_slow_to_be_walking_are_refused_by_every_part() -> None:
    recording, _ = walk(0.25, 1.6)
    assert detect_steps(only(recording, "pelvis")).steps == ()
    with pytest.raises(CalibrationError) as refused:
        calibration.calibrate(recording)
    assert refused.value.code == "no_walking"
