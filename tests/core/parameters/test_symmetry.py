"""Symmetry: the published vector, the sign, and what is left unsaid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import Side
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.symmetry import angle_pct, compare_sides, index_pct, phase_coordination, ratio


def of(
    name: str, left: float | None, right: float | None, unit: str, n: int = 12, sd: float | None = None
) -> tuple[Parameter, ...]:
    return (Parameter(name, "left", n, left, sd, unit), Parameter(name, "right", n, right, sd, unit))


def test_the_vector_of_the_literature() -> None:
    """Non-paretic .39, paretic .25: published (docs/science/phases-and-regularity.md, "Symmetry")."""
    assert ratio(0.39, 0.25) == pytest.approx(1.56)
    assert index_pct(0.39, 0.25) == pytest.approx(43.75)
    assert angle_pct(0.39, 0.25) == pytest.approx(-13.71, abs=0.005)


def test_left_stands_first_where_no_side_is_affected() -> None:
    (found,) = compare_sides(of("step_length_m", 0.39, 0.25, "m"))
    assert (found.first, found.reference) == ("left", "left/right")
    assert found.difference == pytest.approx(0.14)
    assert found.ratio == pytest.approx(1.56)
    assert found.index_pct == pytest.approx(43.75)
    assert found.angle_pct == pytest.approx(-13.71, abs=0.005)


@pytest.mark.parametrize(("affected", "sign"), [("left", 1.0), ("right", -1.0)])
def test_the_affected_side_stands_first(affected: Side, sign: float) -> None:
    (found,) = compare_sides(of("step_length_m", 0.39, 0.25, "m"), affected)
    assert (found.first, found.reference) == (affected, "affected/unaffected")
    assert found.index_pct == pytest.approx(sign * 43.75)
    assert found.difference == pytest.approx(sign * 0.14)
    assert found.angle_pct is not None
    assert np.sign(found.angle_pct) == -sign


@settings(deadline=None)
@given(st.floats(0.1, 2.0), st.floats(0.1, 2.0))
def test_an_index_keeps_the_side_it_turns_its_sign_with_it(a: float, b: float) -> None:
    (left,), (right,) = (compare_sides(of("step_length_m", a, b, "m"), side) for side in ("left", "right"))
    assert left.index_pct == pytest.approx(-right.index_pct)  # type: ignore[operator]
    assert left.angle_pct == pytest.approx(-right.angle_pct)  # type: ignore[operator]
    assert left.ratio == pytest.approx(1.0 / right.ratio)  # type: ignore[operator]


@pytest.mark.parametrize("n", [1, 2, 3])
def test_fewer_than_four_strides_of_a_side_have_no_asymmetry(n: int) -> None:
    left, right = of("step_length_m", 0.51, 0.60, "m", sd=0.01)
    few = replace(right, n=n)
    assert compare_sides((left, few)) == compare_sides((replace(left, n=n), right)) == ()
    assert compare_sides((left, replace(right, n=4)))


def test_sides_differ_clearly_only_where_the_interval_of_the_difference_leaves_out_zero() -> None:
    """Welch's interval of 0.60 ± 0.10 and 0.50 ± 0.05 of four strides: freedom 4.4, so 4."""
    left, right = of("step_length_m", 0.60, 0.50, "m", n=4)
    (open_,) = compare_sides((replace(left, sd=0.10), replace(right, sd=0.05)))
    half = 2.7764 * np.hypot(0.10, 0.05) / 2.0
    assert open_.low == pytest.approx(0.1 - half, abs=1e-4)
    assert open_.high == pytest.approx(0.1 + half, abs=1e-4)
    assert not open_.clear
    (plain,) = compare_sides((replace(left, sd=0.02), replace(right, sd=0.02)))
    assert plain.clear
    (unknown,) = compare_sides((left, right))
    assert (unknown.low, unknown.clear) == (None, False)
    (steady,) = compare_sides(of("stride_length_m", 1.20, 1.10, "m", sd=0.0))
    assert steady.low == steady.high == pytest.approx(0.1)
    assert steady.clear


def test_angles_have_a_difference_and_no_ratio() -> None:
    (found,) = compare_sides(of("knee_flexion_min_stance_deg", 5.0, -1.0, "deg"))
    assert (found.difference, found.ratio, found.index_pct, found.angle_pct) == (6.0, None, None, None)
    assert found.reason == "angle"


@pytest.mark.parametrize(
    ("left", "right"), [(0.03, 0.0), (0.0, 0.0), (0.14, -0.02), (-0.1, -0.1), (0.3, 0.04)]
)
def test_near_zero_nothing_is_divided(left: float, right: float) -> None:
    (found,) = compare_sides(of("circumduction_m", left, right, "m"))
    assert (found.ratio, found.index_pct, found.angle_pct, found.reason) == (None, None, None, "near_zero")
    assert found.difference == pytest.approx(left - right)


def test_a_side_without_a_value_is_not_compared() -> None:
    assert compare_sides(of("step_length_m", 0.5, None, "m")) == ()
    assert compare_sides((Parameter("cadence_spm", None, 9, 100.0, None, "steps/min"),)) == ()


def strides(half: float = 0.5, n: int = 12, swing_left: float = 0.45, wobble: float = 0.0) -> Strides:
    """Strides of 1 s; the right foot lands `half` of it after the left, off by ± `wobble` in turn."""
    made = []
    for k in range(n):
        lands = k + half + wobble * (-1) ** k
        made += [
            Stride("left", k, k + 1.0 - swing_left, k + 1.0, k + 0.1, lands),
            Stride("right", lands, lands + 0.6, lands + 1.0, lands + 0.1, k + 1.0),
        ]
    return Strides(tuple(made))


def test_steps_of_half_a_stride_every_time_are_perfectly_coordinated() -> None:
    found = phase_coordination(strides())
    assert (found.name, found.side, found.n, found.unit) == ("pci_pct", None, 12, "%")
    assert found.mean == pytest.approx(0.0, abs=1e-9)


def test_limping_and_wavering_add_up() -> None:
    # the right foot lands at .55 of a stride of the left, which swings longer: φ = 198°, off by 10 %
    assert phase_coordination(strides(0.55)).mean == pytest.approx(10.0)
    # ± .02 of a stride about one half: φ = 180° ± 7.2°
    wavering = phase_coordination(strides(0.5, wobble=0.02))
    cv = 100.0 * np.std([172.8, 187.2] * 6, ddof=1) / 180.0
    assert wavering.mean == pytest.approx(cv + 4.0)


def test_the_foot_with_the_longer_swing_is_the_reference() -> None:
    # of the right foot's strides the left contact is at .45: the same distance, the other side
    assert phase_coordination(strides(0.55, swing_left=0.3)).mean == pytest.approx(10.0)


def test_few_strides_have_no_coordination() -> None:
    assert phase_coordination(strides(n=9)).reason == "few_strides"
    assert phase_coordination(strides(n=12)).note == "few_strides"
    assert phase_coordination(strides(n=30)).note is None
    assert phase_coordination(Strides(())).reason == "no_strides"
    alone = Strides(tuple(s for s in strides().strides if s.side == "left"))
    assert phase_coordination(alone).reason == "opposite_foot_missing"
