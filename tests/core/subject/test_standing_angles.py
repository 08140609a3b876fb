"""Goniometer angles of standing: accepted input."""

from __future__ import annotations

import pytest

from sagittal.core.angles import SIGNS
from sagittal.core.errors import ParameterError
from sagittal.core.subject.standing_angles import JOINTS, NAMES, check_standing


def test_every_angle_of_the_exports_may_be_entered() -> None:
    assert tuple(name for joint in SIGNS.values() for name, _, _ in joint) == JOINTS
    assert len(NAMES) == 20
    check_standing(dict.fromkeys(NAMES, 5.0))


@pytest.mark.parametrize(
    ("entered", "code"),
    [
        ({"knee": 5.0}, "unknown_angle"),
        ({"knee_flexion": 5.0}, "unknown_angle"),
        ({"pelvis_rotation": 5.0}, "unknown_angle"),
        ({"knee_flexion_l": 61.0}, "standing_angle_implausible"),
        ({"knee_flexion_l": float("nan")}, "standing_angle_implausible"),
    ],
)
def test_what_makes_no_sense_is_refused(entered: dict[str, float], code: str) -> None:
    with pytest.raises(ParameterError) as error:
        check_standing(entered)
    assert error.value.code == code
    assert next(iter(entered)) in error.value.message
