"""Unaffected limbs of simulated people agree with healthy adults at the same speed.

Means over the straight strides of every script, steps alike, against the norms at the walked speed
(core/norms/at_speed.py), valid to v* = 0.65; that the product uses them below comfortable speed only does not
matter here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np
import pytest

from sagittal.core.angles import JointAngles
from sagittal.core.events.result import GaitEvent, GaitEvents
from sagittal.core.frames import SIDES, Side
from sagittal.core.norms.at_speed import angle_values_at_speed, walkway_values_at_speed
from sagittal.core.norms.speed import WalkingSpeed, walking_speed
from sagittal.core.norms.values import list_norm_keys
from sagittal.core.parameters.catalogue import LIMIT_FIGURES
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.simulate import SCRIPTS, STEADY
from sagittal.core.simulate.gait.human import move
from sagittal.core.simulate.script import plan
from sagittal.core.simulate.truth import WalkTruth, truth_of
from sagittal.core.simulate.walker import REFERENCE_HEIGHT_M
from tests.helpers.true_walks import true_tracks

MOST_SD = 1.5

JOINTS: Final = tuple(name for name in list_norm_keys("angles") if name not in LIMIT_FIGURES)

HIP, KNEE, ANKLE = (
    tuple(name for name in JOINTS if name.startswith(joint)) for joint in ("hip_", "knee_", "ankle_")
)

WEAK_PUSH_OFF: Final = ("ankle_dorsiflexion_min_deg", "ankle_dorsiflexion_rom_deg")
"""A foot that pushes off less does not point as far."""

STIFF_SWING: Final = ("knee_flexion_max_swing_deg", "knee_flexion_rom_deg")

_SHORT_STEPS: Final = (*KNEE, "hip_flexion_rom_deg", *WEAK_PUSH_OFF)
"""Knees bent throughout, small excursions of the hip, weak push-off."""

_SHUFFLE: Final = (*_SHORT_STEPS, "ankle_dorsiflexion_max_swing_deg")
"""The foot stays level in swing, so the ankle is as bent as the shank leans."""

AFFECTED: Final[Mapping[str, Mapping[Side, tuple[str, ...]]]] = {
    # the hemiparetic leg as a whole, the other leg not at all
    "hemiparetic": {"left": JOINTS},
    "hemi_mild": {"left": JOINTS},
    "stiff_knee": {"left": (*STIFF_SWING, *WEAK_PUSH_OFF)},
    # the foot hangs; hip and knee lift it over the floor
    "drop_foot": {
        "left": (
            *(name for name in ANKLE if name != "ankle_dorsiflexion_max_stance_deg"),
            "hip_flexion_rom_deg",
            "knee_flexion_max_swing_deg",
        )
    },
    "crouch": {"left": JOINTS, "right": JOINTS},
    # careful with the painful leg: times and distances, and a weak push-off
    "antalgic": {"left": WEAK_PUSH_OFF},
    "parkinson": {"left": _SHORT_STEPS, "right": _SHORT_STEPS},
    "severe_shuffle": {"left": _SHUFFLE, "right": _SHUFFLE},
    "festination": {"left": _SHORT_STEPS, "right": _SHORT_STEPS},
}
"""Joint parameters that a person's gait is meant to change; all others are healthy. Steps of unequal length
and old age change times and distances alone."""

HEALTHY_PACE: Final = tuple(
    name for name in SCRIPTS if name not in AFFECTED and name not in ("step_asym", "elderly")
)
"""Scripts of people whose times and distances are healthy as well."""


@cache
def _truth(name: str) -> WalkTruth:
    scenario = SCRIPTS[name]
    walker = replace(scenario.walker, variability=STEADY)
    motion = move(plan(scenario.script, walker, np.random.default_rng(0)), walker, 200.0)
    return truth_of(motion, 2, {}, {}, 0)


@cache
def _measured(name: str) -> tuple[WalkingSpeed, Mapping[tuple[str, Side | None], float]]:
    """Speed, and means by parameter and side: anatomical angles, feet off the floor 5 mm up."""
    truth = _truth(name)
    events = []
    for side, contacts in truth.contacts.items():
        events += [GaitEvent(t, side, "ic", "truth", t) for t in contacts.contact.tolist()]
        lifts = np.where(np.isnan(contacts.lift5), contacts.release, contacts.lift5)
        events += [GaitEvent(t, side, "tc", "truth", t) for t in lifts.tolist()]
    tracks = replace(
        true_tracks(truth),
        events=GaitEvents(tuple(sorted(events, key=lambda e: e.time_s))),
        angles=JointAngles(truth.t_s, truth.angles, {}),
    )
    result = {(p.name, p.side): p.mean for p in measure_gait(tracks).parameters if p.mean is not None}
    return walking_speed(result["gait_speed_mps", None], REFERENCE_HEIGHT_M), result


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_unaffected_joints_move_as_those_of_healthy_adults(name: str) -> None:
    speed, measurement = _measured(name)
    norms = angle_values_at_speed(None, speed.norm_speed)
    affected = AFFECTED.get(name, {})
    off = {
        (joint, side): f"{value:.1f}, {(value - norm.mean) / norm.sd:+.1f} SD from {norm.mean:.1f}"
        for side in SIDES
        for joint in JOINTS
        if joint not in affected.get(side, ())
        for value, norm in ((measurement[joint, side], norms[joint]),)
        if abs(value - norm.mean) > MOST_SD * norm.sd
    }
    assert off == {}


@pytest.mark.parametrize("name", HEALTHY_PACE)
def test_healthy_people_step_and_support_as_healthy_adults_do(name: str) -> None:
    speed, measurement = _measured(name)
    norms = walkway_values_at_speed(speed.norm_speed, speed.norm_leg_m)
    off = {
        (label, side): f"{value:.2f}, {(value - norms[label].mean) / norms[label].sd:+.1f} SD"
        for (label, side), value in measurement.items()
        if label in norms and abs(value - norms[label].mean) > MOST_SD * norms[label].sd
    }
    assert off == {}


@pytest.mark.parametrize("name", [name for name in AFFECTED if name in SCRIPTS])
def test_what_is_called_affected_is(name: str) -> None:
    """Each affected side differs from healthy adults somewhere: no exemption is unnecessary."""
    speed, measurement = _measured(name)
    norms = angle_values_at_speed(None, speed.norm_speed)
    for side, joints in AFFECTED[name].items():
        assert max(abs(measurement[j, side] - norms[j].mean) / norms[j].sd for j in joints) > MOST_SD


def test_a_weak_push_off_does_not_bend_the_other_knee_at_contact() -> None:
    """The pelvis used to sink onto the stiff leg's low heel, and the healthy knee landed bent by 23°."""
    _, measurement = _measured("stiff_knee")
    assert measurement["knee_flexion_ic_deg", "right"] < 7.0
    assert _truth("stiff_knee").guard_m < 0.008
