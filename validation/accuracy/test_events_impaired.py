"""Contacts of simulated people who do not walk like the textbook, perturbed.

Parameters of swings by their way were chosen on seeds 1, 22 and 23. Here are other seeds, which draw other
steps and mountings, other body heights, rates and noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from sagittal.core import calibration, timeline
from sagittal.core.events.detection import detect_contacts
from sagittal.core.events.foot_movement import measure_foot_movements
from sagittal.core.events.result import EventKind, GaitEvents
from sagittal.core.frames import SIDES, Floats, Segment, Side
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.simulate import IMPAIRED_WALKS, SCRIPTS, WalkTruth, simulate
from sagittal.core.simulate.mems import MEMS
from sagittal.core.simulate.script import scale_script
from tests.helpers.event_scoring import match
from validation.figures import record

PEOPLE = (*IMPAIRED_WALKS, "severe_shuffle", "festination")
WORN: tuple[Segment, ...] = ("pelvis", "foot_l", "foot_r")
WINDOW_S = 0.25
KINDS: tuple[EventKind, EventKind] = ("ic", "tc")
MEAN_MS = 60.0
"""Largest mean error of contacts and foot-offs of a foot against first and last touch of the sole."""


@dataclass(frozen=True)
class Circumstance:
    """One way of recording one person."""

    seed: int
    height_m: float = 1.75
    rate_hz: float = 100.0
    noise: float = 1.0


CIRCUMSTANCES: Mapping[str, Circumstance] = {
    "another seed": Circumstance(41),
    "1.52 m, 50 Hz": Circumstance(42, 1.52, 50.0),
    "1.93 m, 60 Hz": Circumstance(43, 1.93, 60.0),
    "1.60 m, 128 Hz": Circumstance(44, 1.60, 128.0),
    "1.85 m, 200 Hz": Circumstance(45, 1.85, 200.0),
    "noise and bias × 4": Circumstance(46, noise=4.0),
}


@cache
def walked(name: str, how: str) -> tuple[GaitEvents, WalkTruth]:
    at = CIRCUMSTANCES[how]
    scenario = {**SCRIPTS, **IMPAIRED_WALKS}[name]
    walker = scenario.walker.scaled_to(at.height_m)
    setup = replace(scenario.setup, rate_hz=at.rate_hz, worn=WORN, noise=MEMS.times(at.noise))
    take = simulate(scale_script(scenario.script, walker.scale), walker, at.seed, setup)
    calibrated = calibration.calibrate(timeline.synchronise(take.recording))
    orientations = estimate_orientations(calibrated)
    return detect_contacts(orientations, motions=measure_foot_movements(calibrated)), take.truth


def score(name: str, how: str, side: Side, kind: EventKind) -> tuple[Floats, int, int, int]:
    """Errors in ms, how many are true, found too many, missed."""
    found, truth = walked(name, how)
    true = truth.contacts[side].contact if kind == "ic" else truth.contacts[side].release
    result = match(found.times(side, kind), true.tolist(), WINDOW_S)
    return 1e3 * result.errors, len(true), len(result.extra), result.missed


@pytest.mark.parametrize("how", CIRCUMSTANCES)
@pytest.mark.parametrize("name", PEOPLE)
def test_every_step_of_each_is_found_and_none_invented(name: str, how: str) -> None:
    for side in SIDES:
        for kind in KINDS:
            errors, true, extra, missed = score(name, how, side, kind)
            # the right foot of step_to makes a first or last step of 3 cm
            assert missed <= max(1, 0.02 * true), (side, kind)
            assert extra <= max(1, 0.01 * true), (side, kind)
            assert abs(errors.mean()) <= MEAN_MS, (side, kind)


def test_write_down_the_figures() -> None:
    rows = []
    for name in PEOPLE:
        cells = [name]
        for kind in KINDS:
            parts = [score(name, how, side, kind) for how, side in product(CIRCUMSTANCES, SIDES)]
            errors = np.concatenate([p[0] for p in parts])
            true, extra, missed = (sum(p[i] for p in parts) for i in (1, 2, 3))
            means = [float(p[0].mean()) for p in parts]
            cells += [f"{true - missed}/{true}", str(extra), f"{errors.mean():+.0f} ± {errors.std():.0f}",
                      f"{min(means):+.0f} … {max(means):+.0f}"]  # fmt: skip
        rows.append(tuple(cells))
    record(
        "Impaired walks",
        ("person", "IC", "extra", "ms", "means of feet", "TC", "extra", "ms", "means of feet"),
        rows,
        "Simulated, both feet over six circumstances: another seed; 1.52 m at 50 Hz; 1.93 m at 60 Hz; 1.60 m "
        "at 128 Hz; 1.85 m at 200 Hz; four times the noise and bias. Found − truth, first and last touch of "
        "the sole, ± SD. None of these seeds was used to choose a parameter. Limits: 2 % or one missed, 1 % "
        f"or one extra per foot, mean within {MEAN_MS:g} ms.",
    )
