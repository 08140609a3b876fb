"""Joints of a leg, signs of their angles, and unmeasured angles."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.angles.result import SIGNS, JointAngles, list_leg_joints


def test_joints_of_a_leg_are_linked_from_the_pelvis_to_the_foot() -> None:
    assert list_leg_joints("left") == (
        ("hip", "pelvis", "thigh_l"),
        ("knee", "thigh_l", "shank_l"),
        ("ankle", "shank_l", "foot_l"),
    )
    assert [distal for _, _, distal in list_leg_joints("right")] == ["thigh_r", "shank_r", "foot_r"]


def test_only_what_lies_in_the_sagittal_plane_has_one_sign_on_both_sides() -> None:
    for joint, ((_, right, left), *lateral) in SIGNS.items():
        assert right == left == (-1 if joint == "knee" else 1)
        assert [(r, l) for _, r, l in lateral] == [(1, -1), (1, -1)]  # noqa: E741
    assert len({name for names in SIGNS.values() for name, _, _ in names}) == 9


@pytest.mark.parametrize(
    ("told", "names"),
    [
        ({"estimated": ("knee_flexion_l",)}, {"knee_flexion_l"}),
        ({"estimated": ["knee_flexion_l", "hip_flexion_l"]}, {"knee_flexion_l", "hip_flexion_l"}),
        ({"estimated": "knee"}, set()),
        ({}, set()),
    ],
)
def test_estimated_angles_are_those_that_were_listed(told: dict[str, object], names: set[str]) -> None:
    assert JointAngles(np.zeros(0), {}, {}, diagnostics=told).estimated == names
