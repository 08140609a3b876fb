"""One accuracy figure per estimator, asserted on every change; the whole study is in validation/accuracy.

Simulated walks are compared with their truth, recordings with their reference. Limits are those of the study,
rounded up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from math import degrees
from typing import get_args

import numpy as np
import pytest

from sagittal.core.events.detection import detect_contacts
from sagittal.core.events.result import EventKind
from sagittal.core.frames import SIDES, Floats
from sagittal.core.fusion.algorithms.benchmark import read_trial, run_own, score_orientation
from sagittal.core.pipeline import analyse
from sagittal.core.signals.recording import Recording
from sagittal.core.simulate import RecordingSetup, SoftTissue, Squats, simulate_scenario, simulate_squats
from sagittal.core.simulate.squat_chain import place_as_agreed
from tests.data import data_folder
from tests.helpers import force_plate, mobgap
from tests.helpers.event_scoring import match
from tests.helpers.gaitmap import analysed as gaitmap_analysis
from tests.helpers.gaitmap import true_strides
from tests.helpers.ipol import checked_events, ipol_analysis
from tests.helpers.live_walks import recorded
from tests.helpers.neura_angles import scores
from tests.helpers.walks import analysed, neura_analysis, rms_deg, simulated

FLEXION = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
KINDS: tuple[EventKind, ...] = get_args(EventKind)
WALK = "comfortable"
HEIGHT_M = 1.7


def keep_sensors(*segments: str) -> Recording:
    """The simulated walk as recorded by these sensors only."""
    recording = simulate_scenario(WALK, 0).recording
    devices = {device for device, segment in recording.segments.items() if segment in segments}
    return replace(
        recording,
        streams={d: s for d, s in recording.streams.items() if d in devices},
        segments={d: s for d, s in recording.segments.items() if d in devices},
    )


def detect_lower_back_steps(recording: Recording) -> list[float]:
    """Times in s of the steps that an analysis of a single sensor on the lower back detects."""
    contacts = analyse(recording).contacts
    assert contacts is not None
    assert contacts.steps is not None
    return [step.time_s for step in contacts.steps.steps]


def flexion_errors(angles: Mapping[str, Floats]) -> list[float]:
    """RMS error in degrees of hip, knee and ankle, mean of both sides, relative to quiet standing."""
    truth = simulated(WALK)[1].subtract_standing()

    def error(name: str) -> float:
        n = min(len(truth[name]), len(angles[name]))
        return rms_deg(angles[name][:n] - truth[name][:n])

    return [float(np.mean([error(f"{joint}_{side}") for side in "lr"])) for joint in FLEXION]


def test_flexion_from_seven_sensors() -> None:
    angles = analysed(WALK).angles
    assert angles is not None
    assert max(flexion_errors(angles.angles)) <= 1.5


def test_flexion_live() -> None:
    errors = flexion_errors({k: np.radians(x) for k, x in recorded(simulated(WALK)[0]).angles_deg.items()})
    assert max(errors) <= 2.5


@pytest.mark.parametrize(
    ("segments", "limits"),
    [
        pytest.param(("pelvis", "foot_l", "foot_r"), (7.5, 9.0, 6.0), id="three"),
        pytest.param(("foot_l", "foot_r"), (8.0, 11.0, 8.0), id="two"),
    ],
)
def test_flexion_from_few_sensors(segments: tuple[str, ...], limits: tuple[float, ...]) -> None:
    angles = analyse(keep_sensors(*segments)).angles
    assert angles is not None
    assert (np.array(flexion_errors(angles.angles)) <= limits).all()


def test_contacts_of_a_simulated_walk() -> None:
    events, truth = analysed(WALK).events, simulated(WALK)[1]
    assert events is not None
    for side in SIDES:
        of_side = truth.contacts[side]
        for kind, reference in zip(KINDS, (of_side.contact, of_side.release), strict=True):
            score = match(events.times(side, kind), reference.tolist())
            assert (score.missed, len(score.extra)) == (0, 0), (side, kind)
            assert abs(score.mean_ms) <= 30.0, (side, kind)
            assert score.sd_ms <= 10.0, (side, kind)


def test_steps_from_the_lower_back() -> None:
    steps, truth = detect_lower_back_steps(keep_sensors("pelvis")), simulated(WALK)[1]
    contacts = sorted(t for side in SIDES for t in truth.contacts[side].contact)
    score = match(steps, contacts, 0.25)
    assert score.missed + len(score.extra) <= 4


def test_squat_angles() -> None:
    squats = Squats(hinged=True, other="along", valgus_rad=0.0)
    setup = RecordingSetup(tissue=SoftTissue())
    made = simulate_squats(squats, HEIGHT_M, 0, setup, place_as_agreed(HEIGHT_M, SIDES))
    angles = analyse(made.recording).angles
    assert angles is not None
    truth, n = made.truth.subtract_standing(), len(angles.t_s)
    for joint, side in product(("hip_flexion", "knee_flexion"), "lr"):
        name = f"{joint}_{side}"
        assert rms_deg(angles.angles[name] - truth[name][:n]) <= 4.0, name


@pytest.mark.recorded
def test_stride_length_from_shoe_sensors() -> None:
    """Against motion capture, straight strides of about 1.4 m."""
    feet = gaitmap_analysis().feet
    assert feet is not None
    for side in SIDES:
        errors = []
        for stride in true_strides(side):
            a, b = (round(t * 204.8) for t in (stride.start_s, stride.end_s))
            if not stride.turning and b < len(feet.p[side]):
                errors.append(np.linalg.norm((feet.p[side][b] - feet.p[side][a])[:2]) - stride.length_m)
        assert len(errors) >= 20
        assert abs(np.mean(errors)) <= 0.008
        assert np.std(errors) <= 0.020


@pytest.mark.recorded
def test_flexion_against_optical_motion_capture() -> None:
    angles = neura_analysis().angles
    assert angles is not None
    _, found = scores({n: np.degrees(x + angles.zero_offset[n]) for n, x in angles.angles.items()})
    for joint, limit in zip(FLEXION, (3.2, 4.4, 3.0), strict=True):
        errors = [found[f"{joint}_{side}"].offset_removed for side in "lr"]
        assert np.mean(errors) <= limit, joint


@pytest.mark.recorded
def test_contacts_against_hand_checked_events() -> None:
    walk = "11-1"
    events, checked = ipol_analysis(walk).events, checked_events(walk)
    assert events is not None
    for side in SIDES:
        for kind, reference in (("ic", checked.contacts), ("tc", checked.leavings)):
            score = match(events.times(side, kind), reference[side].tolist())  # type: ignore[arg-type]
            assert score.missed <= 1
            assert abs(score.mean_ms) <= 25.0, (side, kind)
            # the last step is set down flat; its contact is ambiguous
            assert 1e3 * np.median(np.abs(score.errors)) <= 15.0, (side, kind)


@pytest.mark.recorded
def test_contacts_against_a_force_plate() -> None:
    orientations, motion, contact, off = force_plate.take()
    events = detect_contacts(orientations, motions={"foot_r": motion})
    # the first contact precedes any foot-off
    for kind, reference in zip(KINDS, (contact[1:], off), strict=True):
        score = match(events.times("right", kind), reference.tolist())
        assert score.missed == 0
        assert abs(score.mean_ms) <= 15.0, kind
        assert score.sd_ms <= 10.0, kind


@pytest.mark.recorded
def test_orientation_against_optical_reference() -> None:
    path = data_folder("broad", "02_undisturbed_slow_rotation_B.npz")
    trial = read_trial(path.stem, path.read_bytes())
    score = score_orientation(run_own(trial, both_ways=False), trial)
    assert degrees(score.total) <= 1.5
    assert degrees(score.inclination) <= 0.7


@pytest.mark.recorded
def test_steps_from_the_lower_back_against_insoles() -> None:
    trial = mobgap.TRIALS[0]
    steps = detect_lower_back_steps(mobgap.recording(trial))
    for period in mobgap.periods(trial):
        inside = [t for t in steps if period.start_s - 0.25 <= t <= period.end_s + 0.25]
        score = match(inside, period.contacts.tolist(), 0.25)
        assert score.missed + len(score.extra) <= 2
