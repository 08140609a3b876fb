"""Left minus right of virtual people, from the whole chain and from ground truth.

Errors common to both sides cancel in comparisons; the remainder is measured. Sensors on skin with impacts and
MEMS errors.
"""

from __future__ import annotations

from typing import Final

import pytest

from sagittal.core.parameters.measure import MeasuredGait
from sagittal.core.parameters.symmetry import compare_sides
from tests.helpers.true_walks import measured_walk
from validation.figures import record

PEOPLE: Final = ("comfortable", "hemiparetic", "hemi_mild", "antalgic", "drop_foot")

LIMITS: Final = {
    "step_time_s": 0.06,
    "step_length_m": 0.03,
    "swing_pct": 4.0,
    "single_support_pct": 4.0,
    "double_support_pct": 1.0,
    "loading_pct": 4.0,
    "push_pct": 4.0,
    "terminal_swing_pct": 3.0,
    "knee_flexion_max_swing_deg": 2.0,
    "ankle_dorsiflexion_max_swing_deg": 2.5,
    "foot_pitch_ic_deg": 2.0,
    "circumduction_m": 0.02,
    "max_heel_clearance_m": 0.02,
    "min_toe_clearance_m": 0.01,
    "step_width_m": 0.02,
}
"""Largest error of left − right. Our choice, from what a foot's place (1 cm) and an angle (1°) are known to.
A contact may be 25 ms off (docs/science/events.md, "Limits on real walks"), and where one foot lands gently
it is so on that foot alone: one step gains and the other loses it. Shares that end at foot-off have as much
again, as the feet leave the floor in different ways."""

SHOWN: Final = (
    "step_time_s", "step_length_m", "swing_pct", "push_pct", "knee_flexion_max_swing_deg",
    "foot_pitch_ic_deg", "circumduction_m", "max_heel_clearance_m", "min_toe_clearance_m",
)  # fmt: skip


def differences(source: MeasuredGait) -> dict[str, float]:
    return {s.name: s.difference for s in compare_sides(source.parameters)}


@pytest.fixture(scope="module")
def walks() -> dict[str, tuple[dict[str, float], dict[str, float]]]:
    """Person → true and found left − right by parameter."""
    pairs = {name: measured_walk(name)[1:] for name in PEOPLE}
    return {name: (differences(true), differences(result)) for name, (true, result) in pairs.items()}


@pytest.mark.parametrize("name", PEOPLE)
def test_sides_differ_as_they_really_do(
    walks: dict[str, tuple[dict[str, float], dict[str, float]]], name: str
) -> None:
    true, result = walks[name]
    for label, limit in LIMITS.items():
        assert result[label] == pytest.approx(true[label], abs=limit), label
        if abs(true[label]) > limit:
            assert result[label] * true[label] > 0.0, label


def test_write_the_table(walks: dict[str, tuple[dict[str, float], dict[str, float]]]) -> None:
    rows = []
    for name, (true, result) in walks.items():
        cells = (f"{result[label]:+.3g} ({true[label]:+.3g})" for label in SHOWN)
        rows.append([name, *cells])
    record(
        "Sides of virtual people compared",
        ["person", *SHOWN],
        rows,
        "Left − right, found (true: the same definitions on true contacts, paths and angles; foot-off is the "
        "last touch). Limits: " + ", ".join(f"{k} {v:g}" for k, v in LIMITS.items()) + "; the sign is right "
        "wherever the true difference exceeds its limit. Simulated: this shows the code, not people.",
    )
