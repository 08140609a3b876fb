"""Goniometer angles of standing: where they go."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.parameters.anatomical_zero import (
    anatomical_curves,
    anatomical_parameters,
    anatomical_variables,
)
from sagittal.core.parameters.result import CycleCurves


def curves(**values: float) -> CycleCurves:
    """One stride per side, constant at so many degrees; a name with _l or _r is of one side."""
    rows: dict[str, dict[Side, Floats]] = {}
    for name, value in values.items():
        base, _, suffix = name.rpartition("_")
        only: tuple[Side, ...] = {"l": ("left",), "r": ("right",)}.get(suffix, SIDES)  # type: ignore[assignment]
        variable = base if suffix in ("l", "r") else name
        for side in only:
            rows.setdefault(variable, {})[side] = np.full((1, 101), np.radians(value))
    one = {s: np.ones(1, np.bool_) for s in SIDES}
    return CycleCurves(rows, dict.fromkeys(SIDES, (0,)), one, {s: np.array([62.0]) for s in SIDES})


def degrees(found: CycleCurves, variable: str, side: Side) -> float:
    return float(np.degrees(found.curves[variable][side][0, 50]))


def test_the_standing_angle_is_added_to_its_own_side_only() -> None:
    found = anatomical_curves(curves(knee_flexion=20.0, hip_flexion=5.0), {"knee_flexion_l": -8.0})
    assert degrees(found, "knee_flexion", "left") == pytest.approx(12.0)
    assert set(found.curves) == {"knee_flexion"}, "what nobody measured has no level"
    assert set(found.curves["knee_flexion"]) == {"left"}


def test_pelvic_tilt_is_one_number_for_both_sides() -> None:
    found = anatomical_curves(curves(pelvis_tilt=2.0), {"pelvis_tilt": 10.0})
    assert [degrees(found, "pelvis_tilt", s) for s in SIDES] == pytest.approx([12.0, 12.0])


def test_obliquity_with_the_right_side_up_lowers_the_left() -> None:
    found = anatomical_curves(curves(pelvis_obliquity=0.0), {"pelvis_obliquity": 3.0})
    assert degrees(found, "pelvis_obliquity", "right") == pytest.approx(3.0)
    assert degrees(found, "pelvis_obliquity", "left") == pytest.approx(-3.0)


def test_the_curves_themselves_are_left_as_they_were() -> None:
    own = curves(knee_flexion=20.0)
    anatomical_curves(own, {"knee_flexion_l": 5.0})
    assert degrees(own, "knee_flexion", "left") == pytest.approx(20.0)


def test_an_angle_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ParameterError) as error:
        anatomical_curves(curves(knee_flexion=20.0), {"knee_l": 3.0})
    assert error.value.code == "unknown_angle"


def test_parameters_have_a_second_value_where_a_goniometer_was_used() -> None:
    found = anatomical_parameters(curves(knee_flexion=20.0, hip_flexion=5.0), {"knee_flexion_l": -8.0})
    assert {p.side for p in found} == {"left"}
    assert {p.name for p in found} == {
        "knee_flexion_ic_deg", "knee_flexion_max_loading_deg", "knee_flexion_min_stance_deg",
        "knee_flexion_max_swing_deg",
    }, "the hip was not measured; a range has no zero"  # fmt: skip
    assert [p.mean for p in found] == pytest.approx([12.0] * 4)
    assert anatomical_parameters(curves(knee_flexion=20.0), {}) == ()


def test_a_variable_has_its_level_when_both_sides_have() -> None:
    entered = {"knee_flexion_l": 1.0, "knee_flexion_r": 0.0, "hip_flexion_l": 3.0, "pelvis_tilt": 10.0}
    assert anatomical_variables(entered) == ("pelvis_tilt", "knee_flexion")
