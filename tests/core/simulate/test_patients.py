"""Each virtual person shows the signature of docs/science/simulation.md, "Virtual people", on several
seeds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core import calibration, events
from sagittal.core.events import FootPitchParams
from sagittal.core.events.foot_pitch import pitch_signal
from sagittal.core.events.result import GaitEvents
from sagittal.core.frames import SIDES, SUFFIX
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import angle_between
from sagittal.core.simulate import (
    PATIENTS,
    SCRIPTS,
    Arc,
    Pivot,
    Simulation,
    Stand,
    Straight,
    Walker,
    WalkTruth,
    simulate_scenario,
)
from sagittal.core.simulate.gait.human import move
from sagittal.core.simulate.script import Script, plan
from sagittal.core.simulate.truth import truth_of
from sagittal.core.simulate.walker import REFERENCE_HEIGHT_M
from sagittal.core.timeline import synchronise
from tests.helpers.event_scoring import match
from tests.helpers.gait_features import Features, features
from tests.helpers.marks import sweep_after
from tests.helpers.walks import joint_gap

SEEDS = (5, 11, 23, 31)

FOREFOOT_FIRST = ("hemiparetic", "drop_foot", "parkinson")
"""Those who land on the forefoot always or now and then: the foot pitches up until it is flat."""

Check = Callable[[Features, Features], dict[str, bool]]


def _ratio(left: float, right: float, low: float, high: float) -> bool:
    return low < left / right < high


SIGNATURES: dict[str, Check] = {
    "healthy": lambda r, left: {
        "steps": _ratio(left.step_m, r.step_m, 0.97, 1.03),
        "stance": _ratio(left.stance, r.stance, 0.97, 1.03),
        "knee": 57 < r.knee_swing < 64,
    },
    "healthy_slow": lambda r, left: {"stance": _ratio(left.stance, r.stance, 0.97, 1.03)},
    "hemiparetic": lambda r, left: {
        "steps": _ratio(left.step_m, r.step_m, 1.2, 1.36),
        "stance": _ratio(left.stance, r.stance, 0.76, 0.87),
        "knee": r.knee_swing - left.knee_swing >= 7 and left.knee_swing < 44.3,
        "contact": left.pitch_contact <= 0,
        "hiked": left.obliquity >= 4,
        "circumducts": left.lateral_mm >= 90 and left.lateral_mm >= 2.5 * r.lateral_mm,
    },
    "hemi_mild": lambda r, left: {
        "steps": _ratio(left.step_m, r.step_m, 1.06, 1.16),
        "stance": _ratio(left.stance, r.stance, 0.86, 0.95),
        "knee": 5 <= r.knee_swing - left.knee_swing <= 13,
        "hiked": 0.8 <= left.obliquity <= 3.5,
    },
    "stiff_knee": lambda r, left: {
        "knee": left.knee_swing < 44.3 and r.knee_swing - left.knee_swing > 17,
        "hiked": left.obliquity > 2.55,
    },
    "drop_foot": lambda r, left: {
        "ankle": left.swing_dorsiflexion < 0 < r.swing_dorsiflexion,
        "contact": left.pitch_contact < 0,
        "steppage": left.hip_max - r.hip_max >= 8 and r.knee_swing - left.knee_swing <= -5,
    },
    "crouch": lambda r, left: {
        "stance": 20 < r.knee_stance_min < 32 and 20 < left.knee_stance_min < 32,
    },
    "antalgic": lambda r, left: {
        "stance": _ratio(left.stance, r.stance, 0.77, 0.88),
        "swing": (100 - left.stance) / (100 - r.stance) > 1.2,
    },
    "parkinson": lambda r, left: {
        "cadence": r.cadence > 125,
        "step": r.step_m < 0.35,
        "push": r.pitch_min > -25,
        "hip": r.hip_range < 30,
        "variable": 2 < 0.5 * (r.stride_cv + left.stride_cv) < 4,
    },
    "severe_shuffle": lambda r, left: {"push": r.pitch_min > -8 and left.pitch_min > -8},
    "step_asym": lambda r, left: {
        "steps": _ratio(left.step_m, r.step_m, 0.70, 0.78),
        "stance": _ratio(left.stance, r.stance, 0.97, 1.03),
    },
    "elderly": lambda r, left: {
        "stance": 63 < r.stance < 67,
        "variable": 1.6 < 0.5 * (r.stride_cv + left.stride_cv) < 3.2,
        "symmetric": _ratio(left.stance, r.stance, 0.97, 1.03),
    },
}


@cache
def walked(name: str, seed: int, rising: bool = True) -> WalkTruth:
    """The named walk without sensors, for the person the script was written for."""
    scenario = SCRIPTS[name]
    walker = replace(scenario.walker, lands_rising=rising)
    motion = move(plan(scenario.script, walker, np.random.default_rng(seed)), walker, 400.0)
    return truth_of(motion, 4, {}, {}, seed)


@cache
def recorded(name: str, seed: int = 5) -> tuple[Simulation, Orientations]:
    """The named walk as sensors see it, shocks included, and the orientations an analysis makes of it."""
    simulation = simulate_scenario(name, seed)
    return simulation, estimate_orientations(calibration.calibrate(synchronise(simulation.recording)))


@cache
def contacts(name: str, seed: int, threshold: float = -0.2, rising: bool = True) -> GaitEvents:
    """Contacts detected by the foot-pitch rule on true orientations."""
    truth = walked(name, seed, rising)
    valid = {s: np.ones(len(truth.t_s), np.bool_) for s in truth.q}
    exact = Orientations(truth.t_s, truth.rate_hz, truth.q, valid, "truth")
    return events.detect(exact, FootPitchParams(threshold=threshold))


def test_every_person_has_a_signature_and_a_script() -> None:
    assert set(SIGNATURES) == set(PATIENTS)
    assert set(PATIENTS) <= set(SCRIPTS)


@pytest.mark.sweep
@pytest.mark.parametrize("name", SIGNATURES)
@pytest.mark.parametrize("seed", SEEDS)
def test_the_signature_shows(name: str, seed: int) -> None:
    truth = walked(name, seed)
    observations = SIGNATURES[name](features(truth, "right"), features(truth, "left"))
    assert [label for label, shows in observations.items() if not shows] == []


@pytest.mark.parametrize("name", SIGNATURES)
@pytest.mark.sweep
def test_every_person_can_turn_stop_and_walk_arcs(name: str) -> None:
    """docs/science/simulation.md, "Limits on construction"."""
    patient = PATIENTS[name]
    step, duration = patient.step_m, patient.step_s
    script: Script = (
        Stand(3.0),
        Straight(6 * step, step, duration),
        Pivot(np.pi, 0.6, duration),
        Stand(2.0),
        Arc(1.6, np.pi, 0.8 * step, duration),
        Arc(1.6, -np.pi, 0.8 * step, duration),
        Stand(2.0),
    )
    motion = move(plan(script, patient.walker, np.random.default_rng(2)), patient.walker, 400.0)
    truth = truth_of(motion, 4, {}, {}, 2)
    assert joint_gap(truth) <= 1e-12
    assert min(np.degrees(truth.angles[f"knee_flexion_{SUFFIX[s]}"].min()) for s in SIDES) >= 2.9
    assert motion.guard_m < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_contacts_of_healthy_walking_are_found_when_they_happen(seed: int) -> None:
    """docs/science/simulation.md, "Virtual people"."""
    for side in SIDES:
        ic = match(
            contacts("healthy", seed).times(side, "ic"),
            walked("healthy", seed).contacts[side].contact.tolist(),
        )
        assert (ic.missed, ic.extra) == (0, ())
        assert abs(ic.mean_ms) <= 10


@pytest.mark.slow
@pytest.mark.parametrize("name", sweep_after(3, list(SIGNATURES)))
@pytest.mark.parametrize("rising", [True, False])
def test_the_rule_invents_nothing_and_finds_all_heel_contacts(name: str, rising: bool) -> None:
    """In both ways of landing: the counts must not rest on the shaped pitch
    (docs/science/simulation.md, "Swing foot")."""
    missed = total = 0
    for side in SIDES:
        true = walked(name, 5, rising).contacts[side].contact.tolist()
        ic = match(contacts(name, 5, rising=rising).times(side, "ic"), true)
        assert ic.extra == ()
        missed, total = missed + ic.missed, total + len(true)
    if name != "severe_shuffle" and name not in FOREFOOT_FIRST:
        assert missed <= 0.02 * total


@pytest.mark.sweep
@pytest.mark.parametrize("name", [n for n in SIGNATURES if n != "severe_shuffle"])
def test_contacts_stay_in_place_on_estimated_orientations_with_shocks(name: str) -> None:
    """What an analysis sees: half a degree of error must not move the maximum of the pitch by 0.1 s."""
    recording, orientations = recorded(name)
    detections = events.detect(orientations)
    for side in SIDES:
        ic = match(detections.times(side, "ic"), recording.truth.contacts[side].contact.tolist())
        assert len(ic.extra) + ic.missed <= 1
        assert abs(float(np.median(ic.errors))) < 0.040


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_a_severe_shuffle_is_refused_with_its_figure(seed: int) -> None:
    result = contacts("severe_shuffle", seed)
    assert result.events == ()
    notices = [n for n in result.notices if n.code == "no_toe_off"]
    assert len(notices) == 2
    for figures in result.diagnostics.values():
        assert -0.15 < figures.s_min < -0.09  # type: ignore[attr-defined]


@pytest.mark.slow
def test_a_landing_on_the_forefoot_has_no_largest_pitch_at_contact() -> None:
    """The pitch rises through contact until the foot is flat, so on a smooth foot the rule finds nothing.

    The counts for a drop foot (docs/science/simulation.md, "Virtual people") come from the shake of its
    contact, not from the pitch.
    """
    truth = walked("drop_foot", 5)
    result = contacts("drop_foot", 5)
    pitch = pitch_signal(truth.q["foot_l"])
    for contact, flat in zip(truth.contacts["left"].contact, truth.contacts["left"].flat, strict=True):
        first, last = np.searchsorted(truth.t_s, (contact, flat))
        assert pitch[first] < 0.0
        assert (np.diff(pitch[first:last]) > 0.0).all()
    assert result.times("left", "ic") == ()
    assert len(result.times("right", "ic")) == len(truth.contacts["right"].contact)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.sweep
def test_a_lower_threshold_loses_the_contacts_of_a_drop_foot(seed: int) -> None:
    """The forefoot touches down at s of about −0.13, below −0.1
    (docs/science/simulation.md, "Virtual people").

    The rule then finds the still foot 0.1 to 0.4 s later; contacts without a detection within 60 ms are lost.
    """
    recording, orientations = recorded("drop_foot", seed)
    lost = {}
    for threshold in (-0.2, -0.1):
        detections = events.detect(orientations, FootPitchParams(threshold=threshold))
        for side in SIDES:
            ic = match(detections.times(side, "ic"), recording.truth.contacts[side].contact.tolist())
            lost[side, threshold] = ic.missed + int(np.sum(np.abs(ic.errors) > 0.06))
    assert lost["left", -0.2] <= 3
    assert lost["left", -0.1] >= 10
    assert lost["right", -0.2] == lost["right", -0.1] == 0


def test_festination_gets_shorter_and_quicker_and_freezes() -> None:
    truth = walked("festination", 5)
    assert len(truth.stands) == 3
    first = [
        f for s in SIDES for f in truth.footprints[s][1:] if f.time_s < truth.stands[1][0] and not f.closes
    ]
    first.sort(key=lambda f: f.time_s)
    assert len(first) == 14
    index = np.arange(14)
    assert np.polyfit(index, [f.step_m for f in first], 1)[0] == pytest.approx(-0.035 * 0.27, rel=0.5)
    assert np.polyfit(index, [f.step_s for f in first], 1)[0] == pytest.approx(-0.02 * 0.43, rel=0.5)


@pytest.mark.slow
def test_a_tall_patient_walks_with_the_same_angles() -> None:
    tall, reference = (
        simulate_scenario("drop_foot", seed=5, height_m=height) for height in (1.9, REFERENCE_HEIGHT_M)
    )
    for name, values in reference.truth.angles.items():
        assert tall.truth.angles[name] == pytest.approx(values, abs=1e-6), name


def test_the_shank_may_turn_with_flexion_and_the_joints_stay() -> None:
    script: Script = (Stand(2.0), Straight(3.2, 0.64, 0.54), Stand(2.0))
    still, turning = (
        move(plan(script, walker, np.random.default_rng(0)), walker, 400.0)
        for walker in (Walker(), Walker(tibial_rotation_rad=np.radians(8.0)))
    )
    for segment, p in still.p.items():
        assert np.array_equal(p, turning.p[segment])
    angles = truth_of(turning, 4, {}, {}, 0).angles
    for end in SUFFIX.values():
        flexion, rotation = angles[f"knee_flexion_{end}"], angles[f"knee_rotation_{end}"]
        assert rotation == pytest.approx(np.radians(8.0) * np.sin(flexion), abs=1e-9)
    assert angle_between(still.q["thigh_l"], turning.q["thigh_l"]).max() < 1e-12
