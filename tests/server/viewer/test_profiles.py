"""The tables of cross-sections: bodies without a hole, a fold or a limb of another length."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.server.viewer import profiles
from sagittal.server.viewer.profiles import ARM, FOOT, HEAD, PELVIS, SHANK, SHOULDER, THIGH, TRUNK, Floats

TABLES = {
    name: getattr(profiles, name) for name in ("THIGH", "SHANK", "FOOT", "PELVIS", "TRUNK", "HEAD", "ARM")
}


@pytest.mark.parametrize("name", TABLES)
def test_sections_follow_each_other_along_the_part(name: str) -> None:
    table = TABLES[name]
    assert table.shape[1] == 5
    assert (np.diff(table[:, 0]) > 0).all()
    if name != "FOOT":
        assert (table[:, 2:] > 0).all(), "every section reaches to all sides"


def test_limbs_go_from_joint_to_joint() -> None:
    for limb in (THIGH, SHANK):
        assert (limb[0, 0], limb[-1, 0]) == (0.0, 1.0)
    # thigh and shank meet in sections of nearly one size
    assert np.abs(THIGH[-1, 2:] / SHANK[0, 2:] - 1.0).max() < 0.2


def test_the_foot_stands_on_the_floor_and_is_as_long_as_it_is() -> None:
    assert FOOT[-1, 0] - FOOT[0, 0] == 1000.0
    _, top, bottom, out, inwards = FOOT.T
    assert (bottom < top).all()
    assert bottom.min() == -1000.0, "nothing is below the floor"
    assert (bottom[4:11] == -1000.0).all()
    assert (np.minimum(out, inwards) > 0).all()


def inside(lower: Floats, upper: Floats) -> bool:
    return bool(lower[0, 0] < upper[0, 0] < lower[-1, 0] < upper[-1, 0])


def test_pelvis_trunk_and_head_overlap() -> None:
    assert inside(PELVIS, TRUNK)
    assert inside(TRUNK, HEAD)


def test_shoulders_and_stature_are_those_of_the_source() -> None:
    """Drillis and Contini: shoulders 0.818 H over the floor, hips 0.530 H, the crown at H."""
    assert SHOULDER[1] + 530 == pytest.approx(818, abs=35)
    assert HEAD[-1, 0] + 530 == pytest.approx(1000, abs=1)
    assert ARM[0, 0] == 0.0
    assert ARM[-1, 0] == pytest.approx(440, abs=12)
