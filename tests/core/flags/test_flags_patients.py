"""Virtual patients with their exact truth: each shows the flags it was made for, healthy walkers none."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core.angles import JointAngles
from sagittal.core.body.feet import FootTracks
from sagittal.core.events.result import Stride, Strides
from sagittal.core.flags import Flag, judge_flags
from sagittal.core.frames import FOOT, SIDES
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.norms.controls import ControlSession, control_group
from sagittal.core.norms.lookup import Norms
from sagittal.core.parameters import cycle_curves, take_figures
from sagittal.core.parameters.result import CycleCurves, Parameter
from tests.helpers.walks import simulated

STRAIGHT = np.radians(10.0)


@cache
def session(name: str, seed: int = 5) -> tuple[CycleCurves, tuple[Parameter, ...], dict[str, float]]:
    """Curves from standing, parameters, and what an exact goniometer reads in standing."""
    truth = simulated(name, seed)[1]
    output = []
    for side in SIDES:
        own = [s for s in truth.strides if s.side == side]
        remaining = [s for s in truth.strides if s.side != side]
        for s in own[1:-1]:
            ic = [o.start_s for o in remaining if s.start_s < o.start_s < s.end_s]
            tc = [o.release_s for o in remaining if s.start_s < o.release_s < s.end_s]
            turned = None if abs(s.turn_rad) < STRAIGHT else "turn"
            first, last = min(tc, default=None), min(ic, default=None)
            output.append(Stride(side, s.start_s, s.release_s, s.end_s, first, last, s.turn_rad, turned))
    strides = Strides(tuple(output))
    angles = JointAngles(truth.t_s, truth.subtract_standing(), truth.zero_offset)
    p, q = ({s: source[FOOT[s]] for s in SIDES} for source in (truth.p, truth.q))
    mask = np.ones(len(truth.t_s), np.bool_)
    feet = FootTracks(
        truth.t_s, truth.rate_hz, p, q, truth.flat, dict.fromkeys(SIDES, mask), True, "truth", truth.body
    )
    oriented = Orientations(truth.t_s, truth.rate_hz, truth.q, dict.fromkeys(truth.q, mask), "truth")
    result = take_figures(strides, angles, oriented, feet).parameters
    standing = {k: float(np.degrees(v)) for k, v in truth.zero_offset.items()}
    return cycle_curves(angles, strides), result, standing


@cache
def controls() -> Norms:
    """Six simulated healthy walks as own controls."""
    people = [
        ControlSession(f"c{seed}", 40.0, None, session("healthy", seed)[1], {}) for seed in (1, 2, 3, 4, 6, 7)
    ]
    return control_group(people).norms()


def raised(name: str, *, goniometer: bool = True) -> set[tuple[str, str | None]]:
    curves, parameters, standing = session(name)
    flags = judge_flags(curves, parameters, standing if goniometer else None, 1.7, controls())
    return {(f.name, f.side) for f in flags if f.exceeded}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["healthy", "healthy_slow"])
def test_a_healthy_walker_raises_nothing(name: str) -> None:
    assert raised(name) == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("stiff_knee", {"stiff_knee", "low_knee_flexion_swing", "circumduction"}),
        ("drop_foot", {"low_dorsiflexion_swing", "flat_contact"}),
        ("hemiparetic", {"flat_contact", "hip_hiking", "circumduction", "low_knee_flexion_swing"}),
    ],
)
def test_each_patient_shows_on_the_affected_left_what_it_was_made_for(name: str, expected: set[str]) -> None:
    assert {(flag, "left") for flag in expected} <= raised(name)


@pytest.mark.slow
def test_asymmetries_have_the_side_they_were_made_with() -> None:
    hemi = raised("hemiparetic")
    assert {
        ("step_length_asymmetry", "left"),
        ("stance_asymmetry", "right"),
        ("swing_asymmetry", "left"),
    } <= hemi
    assert ("temporal_asymmetry", "left") in hemi
    spatial = raised("step_asym")
    assert ("step_length_asymmetry", "right") in spatial
    assert not {n for n, _ in spatial} & {"stance_asymmetry", "swing_asymmetry", "temporal_asymmetry"}


@pytest.mark.slow
def test_without_a_goniometer_levels_are_not_judged_but_sides_are() -> None:
    names = {name for name, _ in raised("stiff_knee", goniometer=False)}
    assert "stiff_knee" in names
    assert not names & {"low_knee_flexion_swing", "knee_hyperextension", "low_hip_extension"}


def test_values_are_those_of_the_patient() -> None:
    curves, parameters, standing = session("stiff_knee")
    result: dict[tuple[str, str | None], Flag] = {
        (f.name, f.side): f for f in judge_flags(curves, parameters, standing, 1.7)
    }
    # as the walker was made: knee 60.3 right, 39.9 left, difference 20.4
    assert result["stiff_knee", "left"].value == pytest.approx(20.4, abs=3.0)
    assert result["low_knee_flexion_swing", "left"].value == pytest.approx(39.9, abs=2.0)
